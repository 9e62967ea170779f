"""Prediction of held-out data: patches of the organ's surface and of bones, and the landmarks, one at a time.

In-sample criteria prefer the wrong model under correlated noise; a patch at least two correlation lengths wide that the fit has not
seen does not. Models are linear around their own best fit here: every patch takes one small solve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.statistics import rms


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
    """The data, row by row, in patches.

    reader : (m, n) takes the data vector to rows, constant (m,) mm is added. patch : (m,) of each row, -1 for
    rows that are never left out. covariance (m, m). points : (p, 3) mm, of the first rows.
    """

    reader: FloatArray
    constant: FloatArray
    patch: IntArray
    covariance: FloatArray
    points: FloatArray

    @property
    def n_patches(self) -> int:
        """Number of patches, of whatever kind."""
        return int(self.patch.max()) + 1

    def left_out(self, models: Sequence[Linear]) -> list[FloatArray]:
        """For each model the residual (m,) mm of every row, predicted without its own patch; rows never left out are 0."""
        rows = [(self.reader @ m.r + self.constant)[:, None] for m in models]
        return [x[:, 0] for x in self.predicted(models, rows)]

    def predicted(self, models: Sequence[Linear], rows: Sequence[FloatArray]) -> list[FloatArray]:
        """The same for residuals (m, d) of each model that are not its own, column by column."""
        out = [np.zeros(r.shape) for r in rows]
        read = [self.reader @ m.J for m in models]
        for p in range(self.n_patches):
            test = self.patch == p
            factor = cho_factor(self.covariance[np.ix_(~test, ~test)], lower=True)
            for model, r, J, residual in zip(models, rows, read, out, strict=True):
                weighed = cho_solve(factor, J[~test])
                H = J[~test].T @ weighed + np.diag(model.precision)
                g = weighed.T @ r[~test] + (model.precision * model.value)[:, None]
                residual[test] = r[test] - J[test] @ np.linalg.solve(H, g)
        return out

    def patch_means(self, squares: FloatArray) -> FloatArray:
        """(patches, ...) mean of squares (m, ...) mm2 over every patch."""
        return np.array([squares[self.patch == p].mean(axis=0) for p in range(self.n_patches)])


@dataclass(frozen=True)
class Gain:
    """What an effect gains on data left out: rms before and after (mm, surface), the gain per patch and its standard error (mm2).

    patches : how many. share : of the mean square before.
    """

    before_mm: float
    after_mm: float
    mean_mm2: float
    error_mm2: float
    share: float
    patches: int = 1

    @property
    def total_mm2(self) -> float:
        """Over all patches."""
        return self.patches * self.mean_mm2

    def __add__(self, other: Gain) -> Gain:
        """Over the patches of both, whose noise is independent; rms as of the first."""
        n = self.patches + other.patches
        mean = (self.total_mm2 + other.total_mm2) / n
        error = float(np.hypot(self.patches * self.error_mm2, other.patches * other.error_mm2)) / n
        before = sum(g.patches * g.mean_mm2 / g.share for g in (self, other) if g.share)
        return Gain(self.before_mm, self.after_mm, mean, error, mean * n / max(before, 1e-30), n)


def gain(split: Split, before: FloatArray, after: FloatArray, noise_mm2: float = np.nan) -> Gain:
    """Compare two models by their residuals (m,) on data left out.

    noise_mm2 : standard error of the gain per patch, see `gain_error`; unknown where not given. The spread from patch to patch is
    none: an effect that acts at one place gains there and nowhere else, and the smaller of two errors is too small.
    """
    a, b = split.patch_means(before**2), split.patch_means(after**2)
    d, error = float((a - b).mean()), noise_mm2
    surface = np.arange(len(split.points))
    return Gain(rms(before[surface]), rms(after[surface]), d, error, d / max(float(a.mean()), 1e-30), len(a))


def gain_error(split: Split, plain: Linear, model: Linear, draws: int, seed: int = 1) -> float:
    """Standard error (mm2) of the gain per patch of a model over the plain one, both seeing the same noise.

    By so many draws of the noise, the model taken for true where it fits best.
    """
    rng = np.random.default_rng(seed)
    noise = np.linalg.cholesky(split.covariance) @ rng.standard_normal((len(split.covariance), draws))
    off = split.reader @ (plain.r - model.r)
    before, after = split.predicted([plain, model], [noise + off[:, None], noise])
    gains = split.patch_means(before**2 - after**2).mean(axis=0)
    return float(gains.std(ddof=1))
