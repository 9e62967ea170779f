"""Swarm search of an identification, with a reduced model of every deformed state and worker processes that hold its
scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from palpate.core.identify import particle_solves
from palpate.core.identify.misfit import Misfit
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.reidentify import keep_for_again
from palpate.core.identify.swarm_misfit import StateEvaluator, values
from palpate.core.identify.swarm_run import SwarmOutcome, run_swarm
from palpate.core.residual.fit_file import FILE
from palpate.core.residual.linearised_model import Linearisation, SolveCount
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint
from palpate.core.worker.executors import make_executor
from palpate.core.worker.messages import Reporter

# Cells of a mesh below which one process makes a reduced model sooner than several that have to start. Speed only: a start takes
# 3 s of a processor, the some 30 solves with their sensitivities 3 s at 6,700 cells.
_CELLS_FOR_PROCESSES = 20_000


def search_with_swarm(
    folder: Path, files: Sequence[Path], fit: PlainFit, options: IdentifyOptions, fingerprint: str, reporter: Reporter
) -> tuple[SwarmOutcome, int]:
    """Swarm search for the least misfit, and how often a reduced model was evaluated.

    files : problem file of each state. Reads the fit's own file in `folder` (`save_fit`). Writes reference.npz,
    reduced.npz (both numbered from the second state on) and swarm.npz into `folder`; again.npz too where there is one
    state only. Raises ConvergenceError when every particle failed.
    """
    parameters = fit.linearisation.first.scene.parameters
    misfit, states = Misfit.of(fit), []
    with ExitStack() as pools:
        for k, (file, linearisation) in enumerate(zip(files, fit.linearisation.each, strict=True)):
            number = "" if k == 0 else f"_{k + 1}"
            reference = folder / f"reference{number}.npz"
            _write_reference(reference, linearisation, fingerprint)
            arguments = (str(file), str(reference), str(folder / FILE), k, options.boundary, options.split_mu)
            processes = _processes(options, fit)
            state = StateEvaluator(pools.enter_context(make_executor(processes, particle_solves.initialise, arguments)))
            if options.reduced:
                start, share = 0.4 + 0.25 * k / len(files), 0.25 / len(files)
                report = lambda f, m, a=start, b=share: reporter.progress(a + b * f, f"reduced model: {m}")  # noqa: E731
                state.build_reduced(parameters.bounds, fingerprint, folder / f"reduced{number}.npz", report)
            states.append(state)
        if options.reduced and len(states) == 1:
            keep_for_again(folder, fit, options, fingerprint)
        outcome = run_swarm(
            lambda thetas: values(misfit, states, fit.model.correction, thetas),
            parameters,
            options,
            folder / "swarm.npz",
            fingerprint,
            reporter,
        )
    for state in states:
        fit.count.include(SolveCount(state.full_solves, state.factorisations, state.failed))
    return outcome, sum(state.reduced_evaluations for state in states)


def _processes(options: IdentifyOptions, fit: PlainFit) -> int:
    """Processes that pay: those that would start for a reduced model of a small mesh take longer than its solves."""
    few = options.reduced and fit.model.first.geometry.space.mesh.cells.shape[0] < _CELLS_FOR_PROCESSES
    return 1 if few else options.workers


def _write_reference(path: Path, at: Linearisation, fingerprint: str) -> None:
    """Write the file that gives every process the wall positions and the start of its solves."""
    if load_checkpoint(path, fingerprint) is None:
        arrays = {"u": at.equilibrium.u, "p": at.equilibrium.p, "walls_u": at.scene.linearised_at}
        save_checkpoint(path, arrays, fingerprint)
