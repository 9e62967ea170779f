"""How many particles a second one, two or more workers solve, and whether their answers are the same to the last bit."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import ExitStack
from functools import lru_cache, partial
from statistics import median
from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import NewtonOptions
from palpate.core.worker.executors import make_executor
from palpate.validate.bench.halved_sphere import BOUNDS, HalvedSphere
from palpate.validate.bench.options import BenchOptions

_OPTIONS = NewtonOptions(stability=False)
# Particles that a worker is handed at once.
_BLOCK = 5


class WorkerFigures(TypedDict):
    """By number of workers: least seconds, and ratios to the first number as medians over the rounds.

    Where others use the machine, processor seconds a particle still tell what more workers cost: `efficiency`.
    """

    particles: int
    cells: int
    processors: int | None
    seconds: dict[str, float]
    speed_up: dict[str, float]
    processor_seconds: dict[str, float]
    efficiency: dict[str, float]
    same_bits: bool


@lru_cache(maxsize=1)
def _scene(divisions: tuple[int, int, int]) -> HalvedSphere:
    """This process's scene, built once."""
    return HalvedSphere(divisions, "p1p1")


def _solved(divisions: tuple[int, int, int], theta: FloatArray) -> FloatArray:
    """Who solved it, the processor seconds it has used so far, and then the displacements that the particle shows."""
    scene = _scene(divisions)
    shown = scene.solve(theta, options=_OPTIONS).u[scene.observed].ravel()
    return np.concatenate([[float(os.getpid()), time.process_time()], shown])


def worker_scaling(options: BenchOptions, tell: Callable[[float, str], None]) -> WorkerFigures:
    """Seconds for the same particles with each number of workers, in turn; speed-up and efficiency as medians over the rounds."""
    solve = partial(_solved, options.reduced_divisions)
    thetas = np.random.default_rng(1).uniform(BOUNDS[:, 0], BOUNDS[:, 1], (options.particles, 2))
    seconds: dict[int, list[float]] = {w: [] for w in options.workers}
    processor: dict[int, list[float]] = {w: [] for w in options.workers}
    digests: dict[int, str] = {}
    with ExitStack() as stack:
        executors = {w: stack.enter_context(make_executor(w)) for w in options.workers}
        used: dict[int, dict[float, float]] = {}
        for w, executor in executors.items():
            tell(0.0, f"workers: {w} are getting their scene")
            used[w] = _warm_up(solve, executor, w)
        for k in range(options.repeats):
            for w, executor in executors.items():
                tell(k / options.repeats, f"workers: round {k + 1}, {w} at work")
                used[w] |= _own_time(w)
                start = time.perf_counter()
                particles = list(executor.map(solve, thetas, chunksize=_BLOCK))
                seconds[w].append(time.perf_counter() - start)
                before, used[w] = used[w], {**used[w], **_used(particles)}
                processor[w].append(sum(used[w][pid] - before[pid] for pid in used[w] if pid in before))
                digests[w] = _digest(particles)
    return _summary(options, len(_scene(options.reduced_divisions).space.mesh.cells), seconds, processor, digests)


def _summary(
    options: BenchOptions,
    cells: int,
    seconds: dict[int, list[float]],
    processor: dict[int, list[float]],
    digests: dict[int, str],
) -> WorkerFigures:
    first = options.workers[0]
    return {
        "particles": options.particles,
        "cells": cells,
        "processors": os.cpu_count(),
        "seconds": {str(w): min(s) for w, s in seconds.items()},
        "speed_up": {
            str(w): median(a / b for a, b in zip(seconds[first], seconds[w], strict=True)) for w in options.workers
        },
        "processor_seconds": {str(w): min(s) for w, s in processor.items()},
        "efficiency": {
            str(w): median(a / b for a, b in zip(processor[first], processor[w], strict=True)) for w in options.workers
        },
        "same_bits": len(set(digests.values())) == 1,
    }


def _warm_up(solve: Callable[[FloatArray], FloatArray], executor: Executor, workers: int) -> dict[float, float]:
    """Until every worker has its scene; processor seconds by process."""
    used: dict[float, float] = {}
    thetas = BOUNDS.mean(axis=1) + np.linspace(0.0, 0.1, 2 * workers)[:, None]
    for _ in range(20):
        used |= _used(list(executor.map(solve, thetas)))
        if len(used) >= workers:
            break
    return used


def _used(particles: list[FloatArray]) -> dict[float, float]:
    """The latest processor seconds of each process that solved one."""
    latest: dict[float, float] = {}
    for pid, seconds in (p[:2].tolist() for p in particles):
        latest[pid] = max(seconds, latest.get(pid, 0.0))
    return latest


def _own_time(workers: int) -> dict[float, float]:
    """One worker is this very process, which has done other things since."""
    return {float(os.getpid()): time.process_time()} if workers == 1 else {}


def _digest(particles: list[FloatArray]) -> str:
    digest = hashlib.sha256()
    for particle in particles:
        digest.update(particle[2:].tobytes())
    return digest.hexdigest()
