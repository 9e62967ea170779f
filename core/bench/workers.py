"""How many particles a second one, two or more workers solve, and whether their answers are the same to the last bit."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import ExitStack
from functools import partial
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.bench.halved_sphere import BOUNDS, HalvedSphere
from palpate.core.bench.options import BenchOptions
from palpate.core.fem.newton import Equilibrium, NewtonOptions
from palpate.core.identify.batch import Particle, solve_many
from palpate.core.worker.executors import make_executor

FloatArray = NDArray[np.float64]
_OPTIONS = NewtonOptions(stability=False)


def observed(scene: HalvedSphere, theta: FloatArray, found: Equilibrium) -> FloatArray:
    """Displacements that the particle shows."""
    return found.u[scene.observed]


def process_id(scene: HalvedSphere, theta: FloatArray, found: Equilibrium) -> FloatArray:
    """Who solved it: tells when every worker has its scene."""
    return np.array(float(os.getpid()))


def worker_scaling(options: BenchOptions, tell: Callable[[float, str], None]) -> dict[str, Any]:
    """Seconds for the same particles with each number of workers, in turn; speed-up as the median of per-round ratios."""
    factory = partial(HalvedSphere, options.reduced_divisions, "p1p1")
    thetas = np.random.default_rng(1).uniform(BOUNDS[:, 0], BOUNDS[:, 1], (options.particles, 2))
    seconds: dict[int, list[float]] = {w: [] for w in options.workers}
    digests: dict[int, str] = {}
    with ExitStack() as stack:
        executors = {w: stack.enter_context(make_executor(w)) for w in options.workers}
        for w, executor in executors.items():
            tell(0.0, f"workers: {w} are getting their scene")
            _warm_up(factory, executor, w)
        for k in range(options.repeats):
            for w, executor in executors.items():
                tell(k / options.repeats, f"workers: round {k + 1}, {w} at work")
                start = time.perf_counter()
                particles = solve_many(factory, thetas, executor, observed, options=_OPTIONS)
                seconds[w].append(time.perf_counter() - start)
                digests[w] = _digest(particles)
    first = options.workers[0]
    return {
        "particles": options.particles,
        "cells": len(factory().space.mesh.cells),
        "processors": os.cpu_count(),
        "seconds": {str(w): median(s) for w, s in seconds.items()},
        "speed_up": {
            str(w): median(a / b for a, b in zip(seconds[first], seconds[w], strict=True)) for w in options.workers
        },
        "same_bits": len(set(digests.values())) == 1,
    }


def _warm_up(factory: Callable[[], HalvedSphere], executor: Executor, workers: int) -> None:
    seen: set[float] = set()
    thetas = BOUNDS.mean(axis=1) + np.linspace(0.0, 0.1, 2 * workers)[:, None]
    for _ in range(20):
        particles = solve_many(factory, thetas, executor, process_id, options=_OPTIONS, block=1)
        seen |= {float(p.value) for p in particles}
        if len(seen) >= workers:
            return


def _digest(particles: list[Particle]) -> str:
    digest = hashlib.sha256()
    for particle in particles:
        digest.update(particle.value.tobytes())
    return digest.hexdigest()
