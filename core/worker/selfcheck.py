"""The smallest kind of job: a particle swarm on a function with many minima. An example for new kinds, and what the worker is tested
with; no step runs it. It lies here because a job's kind must be a module of Palpate."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.inference.swarm import Swarm, SwarmOptions
from palpate.core.inference.swarm_search import search
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint
from palpate.core.worker.executors import make_executor
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter


def run(job: Job, reporter: Reporter) -> dict[str, Any]:
    """Options: iterations (30), pause_s (0): how long an evaluation sleeps, accept (1): value that counts as found.

    Raises ConvergenceError when the value found is above `accept`.
    """
    path, fingerprint = Path(job.folder) / "checkpoint.npz", job.fingerprint()
    stored = load_checkpoint(path, fingerprint)
    options = SwarmOptions(max_iterations=int(job.options.get("iterations", 30)))
    swarm = Swarm([-5.12, -5.12], [5.12, 5.12], job.seed, options) if stored is None else Swarm.from_state(stored)

    def after(swarm: Swarm) -> None:
        save_checkpoint(path, swarm.state(), fingerprint)
        reporter.checkpoint(path, swarm.iteration)
        fraction = swarm.iteration / options.max_iterations
        reporter.progress(
            fraction, "searching", best=swarm.best_value, iteration=swarm.iteration, particles=swarm.ask()
        )

    with make_executor(job.workers) as executor:
        search(swarm, executor, partial(rastrigin, pause_s=float(job.options.get("pause_s", 0.0))), after)
    if swarm.best_value > float(job.options.get("accept", 1.0)):
        raise ConvergenceError(f"the swarm stopped at {swarm.best_value:.3g}; give it more iterations")
    return {"best": swarm.best_value, "position": swarm.best_position.tolist(), "iterations": swarm.iteration}


def rastrigin(x: FloatArray, pause_s: float = 0.0) -> float:
    """Least value 0 at the origin, a local minimum near every other integer point."""
    if pause_s > 0.0:
        time.sleep(pause_s)
    return float(np.sum(x**2 - 10.0 * np.cos(2.0 * np.pi * x) + 10.0))
