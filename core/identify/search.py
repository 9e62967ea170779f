"""The particle swarm over an identification's stiffnesses, checkpointed after every iteration."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import ConvergenceError
from palpate.core.identify import particles
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.particles import ParticleValue
from palpate.core.identify.swarm import Swarm, SwarmOptions
from palpate.core.worker.progress import Progress

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SwarmOutcome:
    """theta (t,) of the best particle, its misfit, the best misfit after each iteration, and the work."""

    theta: FloatArray
    misfit: float
    history: FloatArray
    stop_reason: str
    evaluations: int
    failed: int
    factorisations: int
    positions: FloatArray
    values: FloatArray


def run_swarm(
    executor: Executor,
    bounds: FloatArray,
    options: IdentifyOptions,
    checkpoint: Path,
    progress: Progress,
    cancelled: Callable[[], None],
) -> SwarmOutcome:
    """Search bounds (t, 2) with `particles.evaluate` in the executor's processes; goes on from `checkpoint` if there is one.

    cancelled : raises Cancelled when somebody asked for a stop. Raises ConvergenceError when every particle failed.
    """
    swarm_options = SwarmOptions(
        particles=options.particles, max_iterations=options.iterations, collapse=1e-3, patience=15, keep_positions=True
    )
    swarm = _resume(checkpoint) or Swarm(bounds[:, 0], bounds[:, 1], options.seed, swarm_options)
    work = failed = 0
    while not swarm.should_stop():
        cancelled()
        answers: list[ParticleValue] = list(executor.map(particles.evaluate, list(swarm.ask())))
        work += sum(a.factorisations for a in answers)
        failed += sum(not np.isfinite(a.value) for a in answers)
        swarm.tell([a.value for a in answers])
        _save(checkpoint, swarm)
        done = swarm.iteration / options.iterations
        progress(done, f"swarm, iteration {swarm.iteration}, best misfit {swarm.best_value:.4g}")
    if not np.isfinite(swarm.best_value):
        raise ConvergenceError("no particle of the swarm has an equilibrium; look at the mesh and at the contours")
    positions, values = swarm.track
    return SwarmOutcome(
        swarm.best_position,
        swarm.best_value,
        swarm.history[0],
        swarm.stop_reason() or "",
        swarm.iteration * options.particles,
        failed,
        work,
        positions,
        values,
    )


def _resume(checkpoint: Path) -> Swarm | None:
    if not checkpoint.exists():
        return None
    with np.load(checkpoint, allow_pickle=False) as data:
        return Swarm.from_state({k: data[k] for k in data.files})


def _save(checkpoint: Path, swarm: Swarm) -> None:
    """Whole or not at all: a kill leaves the checkpoint of the iteration before."""
    temporary = checkpoint.with_name(f".{checkpoint.name}.tmp.npz")
    np.savez(temporary, **swarm.state())
    os.replace(temporary, checkpoint)
