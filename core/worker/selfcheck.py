"""The smallest kind of job: a particle swarm on a function with many minima. An example for new kinds, and what the
worker is tested with; no step runs it. It lies here because a job's kind must be a module of Palpate.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Executor
from functools import partial
from pathlib import Path

import msgspec
import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.inference.swarm import Swarm, SwarmOptions
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint
from palpate.core.worker.executors import make_executor
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter


class SelfCheck(msgspec.Struct, frozen=True):
    """Options. pause_s : how long an evaluation sleeps. accept : value that counts as found."""

    iterations: int = 30
    pause_s: float = 0.0
    accept: float = 1.0


def run(job: Job, reporter: Reporter) -> dict[str, object]:
    """Options as `SelfCheck`.

    Raises ConvergenceError when the value found is above `accept`.
    """
    path, fingerprint = Path(job.folder) / "checkpoint.npz", job.fingerprint()
    stored = load_checkpoint(path, fingerprint)
    asked = job.options_as(SelfCheck)
    options = SwarmOptions(max_iterations=asked.iterations)
    swarm = Swarm([-5.12, -5.12], [5.12, 5.12], job.seed, options) if stored is None else Swarm.from_state(stored)

    def after(swarm: Swarm) -> None:
        save_checkpoint(path, swarm.state(), fingerprint)
        reporter.checkpoint(path, swarm.iteration)
        fraction = swarm.iteration / options.max_iterations
        reporter.progress(
            fraction, "searching", best=swarm.best_value, iteration=swarm.iteration, particles=swarm.ask()
        )

    with make_executor(job.workers) as executor:
        search(swarm, executor, partial(rastrigin, pause_s=asked.pause_s), after)
    if swarm.best_value > asked.accept:
        raise ConvergenceError(f"the swarm stopped at {swarm.best_value:.3g}; give it more iterations")
    return {"best": swarm.best_value, "position": swarm.best_position.tolist(), "iterations": swarm.iteration}


def search(
    swarm: Swarm,
    executor: Executor,
    objective: Callable[[FloatArray], float],
    after: Callable[[Swarm], None] = lambda swarm: None,
) -> Swarm:
    """The swarm where a stopping rule is met, its particles evaluated in parallel; `after` hears of every iteration."""
    while not swarm.should_stop():
        swarm.tell(list(executor.map(objective, swarm.ask())))
        after(swarm)
    return swarm


def rastrigin(x: FloatArray, pause_s: float = 0.0) -> float:
    """Least value 0 at the origin, a local minimum near every other integer point."""
    if pause_s > 0.0:
        time.sleep(pause_s)
    return float(np.sum(x**2 - 10.0 * np.cos(2.0 * np.pi * x) + 10.0))
