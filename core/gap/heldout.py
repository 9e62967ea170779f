"""Prediction of what was left out: patches of the organ's surface, and the landmarks, one at a time.

In-sample criteria prefer the wrong model under correlated noise; a patch at least two correlation lengths wide that the fit has not
seen does not. Models are linear around their own best fit here: every patch takes one small solve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from palpate.core.gap.plain import PlainFit

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Width of a patch, mm: two correlation lengths of the contour noise.
PATCH_MM = 14.0
# Points are thinned to about this spacing, mm, and take an independent error of this size, mm.
_SPACING_MM = 4.0
_NUGGET_MM = 0.1


@dataclass(frozen=True, eq=False)
class Linear:
    """A model near its best fit: residual r (n,) of the data vector, J (n, p) its derivative in all parameters.

    value (p,) : how far each parameter is from its prior's centre, in the unit of precision (p,), 1 / variance.
    """

    r: FloatArray
    J: FloatArray
    value: FloatArray
    precision: FloatArray


@dataclass(frozen=True, eq=False)
class Split:
    """The data, point by point, in patches.

    reader : (m, n) takes the data vector to thinned surface points, then landmarks, then bone. patch : (m,) of each row, -1 for
    rows that are never left out. covariance (m, m). points : (surface points, 3) mm.
    """

    reader: FloatArray
    patch: IntArray
    covariance: FloatArray
    points: FloatArray

    @classmethod
    def of(cls, fit: PlainFit) -> Split:
        """Patches of a fitted case."""
        sight, scene = fit.bench.sight, fit.point.scene
        chosen = _thinned(scene.observation.points)
        points = scene.observation.points[chosen]
        k, n = sight.n_modes, sight.n
        reader = np.zeros((len(chosen) + n - k, n))
        reader[: len(chosen), :k] = sight.modes[chosen]
        reader[len(chosen) :, k:] = np.eye(n - k)
        patch = np.full(len(reader), -1)
        patch[: len(chosen)] = _patches(points)
        patch[len(chosen) : len(chosen) + 3 * sight.n_marks] = patch.max() + 1
        covariance = reader @ fit.weighting.covariance @ reader.T
        covariance[np.arange(len(chosen)), np.arange(len(chosen))] += _NUGGET_MM**2
        return cls(reader, patch, covariance, points)

    @property
    def n_surface(self) -> int:
        """Number of surface patches."""
        return int(self.patch[: len(self.points)].max()) + 1

    def left_out(self, models: list[Linear]) -> list[FloatArray]:
        """For each model the residual (m,) mm of every row, predicted without its own patch; rows never left out are 0."""
        out = [np.zeros(len(self.reader)) for _ in models]
        read = [(self.reader @ m.r, self.reader @ m.J) for m in models]
        for p in range(int(self.patch.max()) + 1):
            test = self.patch == p
            if not test.any():
                continue
            factor = cho_factor(self.covariance[np.ix_(~test, ~test)], lower=True)
            for model, (r, J), residual in zip(models, read, out, strict=True):
                weighed = cho_solve(factor, J[~test])
                H = J[~test].T @ weighed + np.diag(model.precision)
                g = weighed.T @ r[~test] + model.precision * model.value
                residual[test] = r[test] - J[test] @ np.linalg.solve(H, g)
        return out

    def patch_means(self, squares: FloatArray) -> FloatArray:
        """(patches,) mean of squares (m,) mm2 over every patch, landmarks last if there are any."""
        return np.array([squares[self.patch == p].mean() for p in range(int(self.patch.max()) + 1)])


@dataclass(frozen=True)
class Gain:
    """What an effect gains on data left out: rms before and after (mm, surface), the gain per patch and its standard error (mm2)."""

    before_mm: float
    after_mm: float
    mean_mm2: float
    error_mm2: float
    share: float

    @property
    def accepted(self) -> bool:
        """At least two paired standard errors, and 10 % of the mean square."""
        return self.mean_mm2 > 2.0 * self.error_mm2 and self.share > 0.1


def gain(split: Split, before: FloatArray, after: FloatArray) -> Gain:
    """Compare two models by their residuals (m,) on data left out."""
    a, b = split.patch_means(before**2), split.patch_means(after**2)
    d = a - b
    surface = np.arange(len(split.points))
    rms = [float(np.sqrt((x[surface] ** 2).mean())) for x in (before, after)]
    error = float(d.std(ddof=1) / np.sqrt(len(d)))
    return Gain(rms[0], rms[1], float(d.mean()), error, float(d.mean() / max(a.mean(), 1e-30)))


def _thinned(points: FloatArray) -> IntArray:
    cube = np.floor(points / _SPACING_MM).astype(np.int64)
    _, first = np.unique(cube, axis=0, return_index=True)
    return np.sort(first)


def _patches(points: FloatArray) -> IntArray:
    """Voronoi cells of points far apart: every next seed is the point farthest from those before."""
    seeds = [int(np.argmin(points[:, 2]))]
    distance = np.linalg.norm(points - points[seeds[0]], axis=1)
    while distance.max() > PATCH_MM:
        seeds.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[seeds[-1]], axis=1))
    return np.argmin(np.linalg.norm(points[:, None] - points[seeds], axis=2), axis=1)
