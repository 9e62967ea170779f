"""Greedy design of a reduced model: full solves where the error estimate is largest, until it is below the
tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.reduced.kernel_interpolation import FIRST_RHO, Features, Fit, best_fit, greedy_points
from palpate.core.worker.progress import Progress


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One full solve: observed displacement (n, 3) mm and, where known, its derivatives (k, n, 3) in each parameter."""

    displacement: FloatArray
    sensitivities: FloatArray | None = None


# Parameters (m, k) -> a snapshot each, None where there is no equilibrium. A batch at a time, so that workers can share
# it.
Solve = Callable[[FloatArray], Sequence[Snapshot | None]]


@dataclass(frozen=True)
class ReducedOptions:
    """tolerance : error aimed at, relative to the largest displacement. safety : factor on the calibrated estimate.

    max_snapshots : full solves to spend. batch : solves between two looks at the estimate; no result depends on the
    workers.
    """

    tolerance: float = 1e-3
    safety: float = 2.0
    max_snapshots: int = 400
    batch: int = 8
    seed: int = 0


class Modes:
    """An orthonormal basis (r, 3 n) that grows until it holds every vector it was given."""

    def __init__(self, size: int, precision: float) -> None:
        self.rows = np.zeros((0, size))
        self.precision = precision

    def add(self, vectors: FloatArray) -> None:
        """Take in vectors (m, 3 n); what is left of them outside is shorter than `precision`."""
        rest = vectors
        for _ in range(2):  # once more, against rounding
            rest = rest - (rest @ self.rows.T) @ self.rows
        _, s, directions = np.linalg.svd(rest, full_matrices=False)
        self.rows = np.vstack([self.rows, directions[s > self.precision]])


@dataclass(frozen=True, eq=False)
class Design:
    """Snapshots and the interpolant through them.

    x : (s, k) on [-1, 1]^k. data : (s, q, r) in coordinates of modes (r, 3 n). scale : smallest of the snapshots'
    largest displacements, mm. calibration : mm per unit of power function, safety included. worst : largest estimate in
    the box, mm. failed : (f, k) where there was no equilibrium.
    """

    x: FloatArray
    data: FloatArray
    modes: FloatArray
    fit: Fit
    scale: float
    calibration: float
    worst: float
    failed: FloatArray


def explore(solve: Solve, bounds: FloatArray, options: ReducedOptions, progress: Progress) -> Design:
    """Solve at greedy points of the box bounds (k, 2) until the largest estimate is below tolerance or the solves are
    spent.

    Raises ConvergenceError when most of the first points have no equilibrium.
    """
    k = len(bounds)
    candidates = _candidates(k, options.seed)
    collected = _Collected(bounds, solve)
    fit: Fit | None = None
    features = Features.enough_for(k, 1, FIRST_RHO)
    first = min(4 + 4 * k, options.max_snapshots)
    while True:
        chosen = first if fit is None else min(options.batch, options.max_snapshots - collected.solves)
        explained = None if fit is None else fit.explained
        picked = greedy_points(candidates, chosen, features, explained, collected.with_gradients)
        candidates = collected.take(candidates, picked)
        if len(collected.x) < max(2, first // 2):
            raise ConvergenceError(
                f"{len(collected.failed)} of {collected.solves} corners of the parameter box have no equilibrium; narrow the bounds"
            )
        fit = best_fit(collected.x, collected.data(), None if fit is None else fit.features.rho)
        features = fit.features
        calibration = options.safety * _calibration(fit, collected.modes.rows)
        worst = calibration * float(fit.power(candidates).max())
        progress(
            min(1.0, collected.solves / options.max_snapshots),
            f"{collected.solves} full solves, error at most {100 * worst / collected.scale:.2g} % of the largest displacement",
        )
        if worst <= options.tolerance * collected.scale or collected.solves >= options.max_snapshots:
            break
    return Design(
        collected.x,
        collected.data(),
        collected.modes.rows,
        fit,
        collected.scale,
        calibration,
        worst,
        collected.failed,
    )


class _Collected:
    """Snapshots so far."""

    def __init__(self, bounds: FloatArray, solve: Solve) -> None:
        self._centre, self._half = bounds.mean(axis=1), 0.5 * (bounds[:, 1] - bounds[:, 0])
        self._solve = solve
        self.x, self.failed = np.zeros((0, len(bounds))), np.zeros((0, len(bounds)))
        self.with_gradients = True
        self.scale = np.inf
        self.modes = Modes(0, 0.0)
        self._rows: list[FloatArray] = []

    @property
    def solves(self) -> int:
        return len(self.x) + len(self.failed)

    def take(self, candidates: FloatArray, picked: IntArray) -> FloatArray:
        """Solve at candidates[picked]; returns the candidates that are left."""
        x = candidates[picked]
        snapshots = self._solve(self._centre + self._half * x)
        good = np.array([f is not None for f in snapshots], dtype=bool)
        self.x, self.failed = np.vstack([self.x, x[good]]), np.vstack([self.failed, x[~good]])
        for snapshot in snapshots:
            if snapshot is not None:
                self._add(snapshot)
        keep = np.ones(len(candidates), dtype=bool)
        keep[picked] = False
        for bad in self.failed:
            keep &= np.abs(candidates - bad).max(axis=1) > 0.1
        return candidates[keep]

    def _add(self, snapshot: Snapshot) -> None:
        u = snapshot.displacement
        rows = u.reshape(1, -1)
        self.with_gradients = self.with_gradients and snapshot.sensitivities is not None
        if snapshot.sensitivities is not None:
            slopes = snapshot.sensitivities.reshape(len(self._half), -1) * self._half[:, None]
            rows = np.vstack([rows, slopes])
        self._rows.append(rows)
        largest = float(np.linalg.norm(u, axis=1).max())
        if not self.modes.rows.size:
            self.modes = Modes(u.size, 1e-6 * largest)
        self.scale = min(self.scale, largest)
        self.modes.add(rows)

    def data(self) -> FloatArray:
        """(s, q, r) coordinates of values and slopes; values alone as soon as one snapshot came without slopes."""
        q = 1 + len(self._half) if self.with_gradients else 1
        return np.stack([rows[:q] @ self.modes.rows.T for rows in self._rows])


def _calibration(fit: Fit, modes: FloatArray) -> float:
    """Largest leave-one-out error (mm, of the worst point) per unit of power function: the norm that the bound
    needs.
    """
    errors = np.linalg.norm((fit.left_out @ modes).reshape(len(fit.left_out), -1, 3), axis=2).max(axis=1)
    return float((errors / fit.left_out_power).max())


def _candidates(k: int, seed: int) -> FloatArray:
    """Points (c, k) of [-1, 1]^k, dense at its faces as Chebyshev's nodes are, with the corners and the centre."""
    spread = qmc.Sobol(k, seed=seed).random_base2(11)
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * k, indexing="ij")).reshape(k, -1).T
    return np.vstack([-np.cos(np.pi * spread), corners, np.zeros((1, k))])
