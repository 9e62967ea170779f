"""Swarm search of an identification, with a reduced model of every deformed state and worker processes that hold its
scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.identify import particle_solves
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.plain_fit import Counter, StateProblem
from palpate.core.identify.reidentify import keep_for_again
from palpate.core.identify.swarm_misfit import Evaluator
from palpate.core.identify.swarm_run import SwarmOutcome, run_swarm
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint
from palpate.core.worker.executors import make_executor
from palpate.core.worker.messages import Reporter


def search_with_swarm(
    folder: Path,
    files: Sequence[Path],
    states: Sequence[StateProblem],
    options: IdentifyOptions,
    fingerprint: str,
    reporter: Reporter,
    count: Counter,
) -> SwarmOutcome:
    """Swarm search around the states' equilibria.

    files : problem file of each state. Writes reference.npz, reduced.npz (both numbered from the second state on) and
    swarm.npz into `folder`; again.npz too where there is one state only. Raises ConvergenceError when every particle
    failed.
    """
    parameters = states[0].scene.parameters
    evaluators: list[Evaluator] = []
    with ExitStack() as pools:
        for k, (file, state) in enumerate(zip(files, states, strict=True)):
            number = "" if k == 0 else f"_{k + 1}"
            reference = folder / f"reference{number}.npz"
            _write_reference(reference, state, fingerprint)
            arguments = (str(file), str(reference), options.boundary, options.element, options.split_mu)
            executor = pools.enter_context(make_executor(options.workers, particle_solves.initialise, arguments))
            evaluators.append(Evaluator(state.misfit, executor))
            if options.reduced:
                start, share = 0.3 + 0.3 * k / len(states), 0.3 / len(states)
                report = lambda f, m, a=start, b=share: reporter.progress(a + b * f, f"reduced model: {m}")  # noqa: E731
                evaluators[-1].build_reduced(parameters.bounds, fingerprint, folder / f"reduced{number}.npz", report)
        if options.reduced and len(states) == 1:
            keep_for_again(folder, states[0].misfit, options, fingerprint)
        outcome = run_swarm(
            lambda thetas: _added(evaluators, thetas), parameters, options, folder / "swarm.npz", fingerprint, reporter
        )
    for evaluator in evaluators:
        count.solves += evaluator.full_solves
        count.factorisations += evaluator.factorisations
        count.failed += evaluator.failed
        count.reduced += evaluator.reduced_evaluations
    return outcome


def _added(evaluators: Sequence[Evaluator], thetas: FloatArray) -> FloatArray:
    return np.asarray(sum(evaluator.values(thetas) for evaluator in evaluators), dtype=np.float64)


def _write_reference(path: Path, state: StateProblem, fingerprint: str) -> None:
    """Write the file that gives every process the wall positions and the start of its solves."""
    if load_checkpoint(path, fingerprint) is None:
        equilibrium = state.equilibrium
        save_checkpoint(
            path, {"u": equilibrium.u, "p": equilibrium.p, "walls_u": state.scene.linearised_at}, fingerprint
        )
