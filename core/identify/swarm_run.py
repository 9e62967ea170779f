"""Particle swarm over the stiffness parameters, with a checkpoint after every iteration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.identify.options import IdentifyOptions
from palpate.core.inference.swarm import Swarm, SwarmOptions
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint
from palpate.core.worker.messages import Reporter

# Misfit (m,) as a function of thetas (m, t); infinite where there is no equilibrium.
Values = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class SwarmOutcome:
    """Result of the swarm.

    theta : (t,) of the best particle. misfit : of the best particle. history : best misfit after each iteration.
    stop_reason : as in `Swarm.stop_reason`. evaluations : number of particles evaluated. positions, values : every
    position and its misfit.
    """

    theta: FloatArray
    misfit: float
    history: FloatArray
    stop_reason: str
    evaluations: int
    positions: FloatArray
    values: FloatArray


def run_swarm(
    values: Values,
    parameters: StiffnessParameters,
    options: IdentifyOptions,
    checkpoint: Path,
    fingerprint: str,
    reporter: Reporter,
) -> SwarmOutcome:
    """Search for the smallest misfit within the parameters' bounds.

    Continues from `checkpoint` if its fingerprint is that of this job. Raises ConvergenceError when every particle
    failed.
    """
    bounds = parameters.bounds
    swarm_options = SwarmOptions(
        particles=options.particles, max_iterations=options.iterations, collapse=1e-3, patience=15, keep_positions=True
    )
    swarm = _resume(checkpoint, fingerprint) or Swarm(bounds[:, 0], bounds[:, 1], options.seed, swarm_options)
    while not swarm.should_stop():
        asked = swarm.ask()
        swarm.tell(values(asked))
        save_checkpoint(checkpoint, swarm.state(), fingerprint)
        reporter.checkpoint(checkpoint, swarm.iteration)
        reporter.progress(
            0.6 + 0.3 * swarm.iteration / options.iterations,
            f"swarm, iteration {swarm.iteration}, least weighted sum of squares {swarm.best_value:.5g}",
            best=swarm.best_value,
            iteration=swarm.iteration,
            particles=[parameters.shear_moduli(theta) for theta in asked],
        )
    if not np.isfinite(swarm.best_value):
        raise ConvergenceError("no particle of the swarm has an equilibrium; look at the mesh and at the contours")
    positions, track_values = swarm.track
    return SwarmOutcome(
        swarm.best_position,
        swarm.best_value,
        swarm.history[0],
        swarm.stop_reason() or "",
        swarm.iteration * options.particles,
        positions,
        track_values,
    )


def _resume(checkpoint: Path, fingerprint: str) -> Swarm | None:
    state = load_checkpoint(checkpoint, fingerprint)
    return None if state is None else Swarm.from_state(state)
