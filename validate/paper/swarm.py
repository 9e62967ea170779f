"""The paper's workload: about 4,000 tetrahedra, two unknown stiffnesses, a swarm of 40 for 50 iterations (its Fig 10, section 4.3).

Three ways to the same optimum, timed: the swarm on a reduced model that is built for it, with a full solve where it ends;
Gauss-Newton from five starts with the quick element, ended with the one that does not lock; and a new deformed surface
on the reduced model that is there.
"""

from __future__ import annotations

import time
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import State
from palpate.core.inference.gauss_newton import GaussNewtonResult, Linearise, gauss_newton
from palpate.core.inference.swarm import Swarm, SwarmOptions
from palpate.core.reduced.greedy_design import Snapshot
from palpate.core.reduced.reduced_model import ReducedModel
from palpate.core.worker.executors import make_executor, one_thread
from palpate.core.worker.progress import Progress, silent
from palpate.validate.paper import tumour_worker
from palpate.validate.paper.reduced_fit import ReducedFit
from palpate.validate.paper.tumour_data import DATA_DIVISIONS, DATA_ELEMENT, TumourData, tumour_data
from palpate.validate.paper.tumour_fit import REDUCED, TumourFit
from palpate.validate.paper.tumour_scene import Divisions
from palpate.validate.paper.tumour_worker import Spec

# The element that looks for the optimum first.
SCOUT = "p1p1"
TRUTH_MU = (70.0, 30.0)
# Iterations of which the positions are kept for the picture.
SHOWN = (0, 4, 14, -1)


class BySwarm(TypedDict):
    """Optimum mu (2,) kPa of the swarm, and seconds of each part of the way to it; best : value of each iteration."""

    particles: int
    iterations: int
    mu_kpa: FloatArray
    seconds: dict[str, float]
    full_solves: int
    best: FloatArray


class ByGaussNewton(TypedDict):
    """Optimum mu (2,) kPa of the best start, and what all starts cost."""

    starts: int
    mu_kpa: FloatArray
    seconds: float
    cpu_seconds: float
    full_solves: int


class NewSurface(TypedDict):
    """mu (2,) kPa of another deformed surface on the reduced model that is there."""

    truth_mu_kpa: tuple[float, float]
    mu_kpa: FloatArray
    seconds: float
    cpu_seconds: float


class Workload(TypedDict):
    """What the paper's run took."""

    seconds: float
    cores: int
    cells: int


class Landscape(TypedDict):
    """The objective (rows: right half) over the box of both halves' mu."""

    mu_left_kpa: FloatArray
    mu_right_kpa: FloatArray
    objective: list[list[float]]


class Positions(TypedDict):
    """Where the particles were in some iterations, mu (n, 2) kPa each, and the objective (n,) there."""

    iterations: list[int]
    mu_kpa: list[FloatArray]
    values: list[FloatArray]


class Shown(Positions):
    """The same over the objective, for the picture."""

    landscape: Landscape


class SwarmTable(TypedDict):
    """Three ways to one optimum."""

    study: str
    cells: int
    element: str
    data_cells: int
    data_element: str
    workers: int
    truth_mu_kpa: tuple[float, float]
    swarm: BySwarm
    gauss_newton: ByGaussNewton
    again: NewSurface
    largest_ln_G_difference: float
    posterior_sd_ln_G: FloatArray
    paper: Workload
    shown: Shown


@dataclass(frozen=True)
class SwarmStudyOptions:
    """identify, data : meshes. particles, iterations : of the swarm. starts : of Gauss-Newton. workers : processes."""

    identify: Divisions = field(default_factory=Divisions)
    data: Divisions = DATA_DIVISIONS
    element: str = "p2p1"
    particles: int = 40
    iterations: int = 50
    starts: int = 5
    workers: int = 2
    seed: int = 1

    @classmethod
    def quick(cls, seed: int = 1) -> SwarmStudyOptions:
        """A coarse mesh, one process."""
        return cls(Divisions(2, 1, 1), Divisions(4, 1, 1), iterations=30, workers=1, seed=seed)


def swarm_study(options: SwarmStudyOptions | None = None, progress: Progress = silent) -> SwarmTable:
    """Seconds and optimum of each way; `largest_ln_G_difference` between them; the swarm's positions for the picture."""
    o = options or SwarmStudyOptions()
    with one_thread():
        progress(0.0, "a pair of known stiffness")
        data = tumour_data(0.0, TRUTH_MU[0], o.data, TRUTH_MU[0], TRUTH_MU[1])
        progress(0.1, "Gauss-Newton")
        descent, descent_s, solves = _descend(data, o)
        progress(0.3, "swarm")
        fit, swarm, ended, seconds, solved = _swarm(data, o, lambda f, m: progress(0.3 + 0.6 * f, m))
        progress(0.9, "a new surface")
        other = tumour_data(0.0, 45.0, o.data, 45.0, 25.0)
        new, again_s = _again(fit, other)
    one, bounds = fit.of(data.organ.deformed), fit.scene.parameters.bounds
    progress(1.0, "done")
    return {
        "study": "swarm",
        "cells": o.identify.cells,
        "element": o.element,
        "data_cells": o.data.cells,
        "data_element": DATA_ELEMENT,
        "workers": o.workers,
        "truth_mu_kpa": TRUTH_MU,
        "swarm": {
            "particles": o.particles, "iterations": swarm.iteration, "mu_kpa": np.exp(ended) / 4.0, "seconds": seconds,
            "full_solves": solved, "best": swarm.history[0],
        },
        "gauss_newton": {
            "starts": o.starts, "mu_kpa": np.exp(descent.theta) / 4.0, "seconds": descent_s[0],
            "cpu_seconds": descent_s[1], "full_solves": solves,
        },
        "again": {"truth_mu_kpa": (45.0, 25.0), "mu_kpa": new, "seconds": again_s[0], "cpu_seconds": again_s[1]},
        "largest_ln_G_difference": float(np.abs(ended - descent.theta).max()),
        "posterior_sd_ln_G": one.posterior(descent, bounds).sd,
        "paper": {"seconds": 24 * 3600.0, "cores": 1, "cells": 4000},
        "shown": {**_positions(swarm), "landscape": _landscape(one, bounds)},
    }  # fmt: skip


def _positions(swarm: Swarm) -> Positions:
    positions, values = swarm.track
    shown = [k for k in SHOWN if k < len(positions)]
    return {
        "iterations": [k % len(positions) + 1 for k in shown],
        "mu_kpa": [np.exp(positions[k]) / 4.0 for k in shown],
        "values": [values[k] for k in shown],
    }


def _swarm(
    data: TumourData, o: SwarmStudyOptions, tell: Progress
) -> tuple[TumourFit, Swarm, FloatArray, dict[str, float], int]:
    """Build the reduced model in worker processes, let the swarm move on it, end with a full linearisation."""
    began, cpu = time.perf_counter(), time.process_time()
    spec = Spec(data.organ.rest, o.identify, o.element, o.data)
    with make_executor(o.workers, tumour_worker.initialise, (spec,)) as executor:
        bounds = spec.scene().parameters.bounds
        model = ReducedModel.build(lambda t: _snapshots(executor, t), bounds, "", REDUCED, tell)
    built = time.perf_counter()
    fit = TumourFit(data.organ.rest, o.identify, o.element, o.data, model=model)
    one = fit.of(data.organ.deformed)
    settings = SwarmOptions(o.particles, max_iterations=o.iterations, collapse=0.0, keep_positions=True)
    swarm = Swarm(bounds[:, 0], bounds[:, 1], o.seed, settings)
    while not swarm.should_stop():
        swarm.tell([one.value(theta) for theta in swarm.ask()])
    moved = time.perf_counter()
    end = gauss_newton(_full(fit, one), swarm.best_position, bounds, max_evaluations=3)
    if end is None:
        raise ConvergenceError("the swarm's best particle has no equilibrium")
    done = time.perf_counter()
    seconds = {"reduced_model": built - began, "swarm": moved - built, "full_end": done - moved, "all": done - began}
    if o.workers == 1:
        seconds["processor"] = time.process_time() - cpu
    return fit, swarm, end.theta, seconds, model.solves + end.evaluations


def _snapshots(executor: Executor, thetas: FloatArray) -> list[Snapshot | None]:
    return list(executor.map(tumour_worker.snapshot, list(thetas)))


def _full(fit: TumourFit, one: ReducedFit) -> Linearise:
    """The linearisation of a fit by full solves, each started from the one before."""
    last: list[State | None] = [None]

    def linearise(theta: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        shot, last[0] = fit.solve(theta, last[0])
        if shot is None or shot.sensitivities is None:
            return None
        return one.linearised(shot.displacement, shot.sensitivities)

    return linearise


def _descend(data: TumourData, o: SwarmStudyOptions) -> tuple[GaussNewtonResult, FloatArray, int]:
    """Gauss-Newton from every start with `SCOUT`, then from the best end with the chosen element; seconds by the clock and
    of the processor, full solves."""
    began = np.array([time.perf_counter(), time.process_time()])
    scout = TumourFit.without_model(data.organ.rest, o.identify, SCOUT, o.data)
    bounds = scout.scene.parameters.bounds
    share = (0.5 + np.outer(np.arange(o.starts), [0.755, 0.570])) % 1.0  # R-sequence (Roberts 2018)
    starts = bounds[:, 0] + (0.1 + 0.8 * share) * (bounds[:, 1] - bounds[:, 0])
    target = scout.of(data.organ.deformed)
    ends = [gauss_newton(_full(scout, target), start, bounds) for start in starts]
    found = [end for end in ends if end is not None]
    if not found:
        raise ConvergenceError("no start of Gauss-Newton could be solved")
    best = min(found, key=lambda end: end.misfit)
    final = TumourFit.without_model(data.organ.rest, o.identify, o.element, o.data)
    end = gauss_newton(_full(final, final.of(data.organ.deformed)), best.theta, bounds)
    if end is None:
        raise ConvergenceError("the best of Gauss-Newton's ends has no equilibrium with the chosen element")
    seconds = np.array([time.perf_counter(), time.process_time()]) - began
    return end, seconds, sum(e.evaluations for e in found) + end.evaluations


def _again(fit: TumourFit, data: TumourData) -> tuple[FloatArray, tuple[float, float]]:
    """mu found on the model that is there; seconds by the clock and of the processor."""
    began, cpu = time.perf_counter(), time.process_time()
    found = fit.identify(data)
    return found.mu, (time.perf_counter() - began, time.process_time() - cpu)


def _landscape(one: ReducedFit, bounds: FloatArray, points: int = 31) -> Landscape:
    axes = [np.linspace(low, high, points) for low, high in bounds]
    values = [[one.value(np.array([a, b])) for a in axes[0]] for b in axes[1]]
    return {"mu_left_kpa": np.exp(axes[0]) / 4.0, "mu_right_kpa": np.exp(axes[1]) / 4.0, "objective": values}
