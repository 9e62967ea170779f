"""The reduced model of a two-parameter scene, judged by full solves it never saw."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import NewtonOptions
from palpate.core.reduced.greedy_design import Snapshot
from palpate.core.reduced.reduced_model import ReducedModel
from palpate.core.worker.progress import Progress
from palpate.validate.bench.halved_sphere import BOUNDS, HalvedSphere
from palpate.validate.bench.options import BenchOptions


class ReducedFigures(TypedDict):
    """Cost of the model and of one evaluation, its largest error (of the largest displacement), and its estimate over that error."""

    cells: int
    parameters: int
    setup_solves: int
    setup_seconds: float
    setup_cpu_seconds: float
    full_solve_ms: float
    evaluation_ms: float
    unseen: int
    largest_error_percent: float
    estimate_over_error_smallest: float
    estimate_over_error_median: float


def snapshots(scene: HalvedSphere, thetas: FloatArray) -> list[Snapshot | None]:
    """Full solves with sensitivities, each from rest."""
    out: list[Snapshot | None] = []
    for theta in thetas:
        found = scene.solve(theta)
        slopes = scene.sensitivities(theta, found)[:, scene.observed] if found.converged else None
        out.append(Snapshot(found.u[scene.observed], slopes) if found.converged else None)
    return out


def reduced_study(options: BenchOptions, tell: Progress) -> ReducedFigures:
    """Set-up, milliseconds an evaluation, error on unseen particles (corners of the box among them) and honesty of the estimate."""
    scene = HalvedSphere(options.reduced_divisions, "p1p1")
    start, cpu = time.perf_counter(), time.process_time()
    model = ReducedModel.build(lambda t: snapshots(scene, t), BOUNDS, "", progress=tell)
    setup, setup_cpu = time.perf_counter() - start, time.process_time() - cpu
    thetas = np.random.default_rng(2).uniform(BOUNDS[:, 0], BOUNDS[:, 1], (options.unseen, 2))
    thetas[:4] = np.array(np.meshgrid(*BOUNDS)).reshape(2, -1).T
    u, full_s = _full(scene, thetas)
    error = np.linalg.norm(model.evaluate(thetas) - u, axis=2).max(axis=1)
    estimate = model.error_estimate(thetas)
    return {
        "cells": len(scene.space.mesh.cells),
        "parameters": len(BOUNDS),
        "setup_solves": model.solves,
        "setup_seconds": setup,
        "setup_cpu_seconds": setup_cpu,
        "full_solve_ms": 1e3 * full_s,
        "evaluation_ms": 1e3 * _seconds_each(model, thetas),
        "unseen": len(thetas),
        "largest_error_percent": 100.0 * float(error.max()) / model.scale,
        "estimate_over_error_smallest": float((estimate / error).min()),
        "estimate_over_error_median": float(np.median(estimate / error)),
    }


def _full(scene: HalvedSphere, thetas: Sequence[FloatArray] | FloatArray) -> tuple[FloatArray, float]:
    start = time.perf_counter()
    found = [scene.solve(t, options=NewtonOptions(stability=False)) for t in thetas]
    seconds = (time.perf_counter() - start) / len(found)
    return np.array([f.u[scene.observed] for f in found]), seconds


def _seconds_each(model: ReducedModel, thetas: FloatArray) -> float:
    seconds = []
    for theta in thetas:
        start = time.perf_counter()
        model.evaluate(theta)
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds))
