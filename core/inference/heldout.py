"""Prediction of held-out data: blocks of the organ's surface and of matched motion, and the landmarks, one at a time.

In-sample criteria prefer the wrong model under correlated noise; a patch at least two correlation lengths wide that the fit has not
seen does not. Models are linear around their own best fit here: every patch takes one small solve.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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

    reader : (m, n) takes the data vector to rows. patch : (m,) of each row, -1 for
    rows that are never left out. covariance (m, m). parts : rows of what is told apart, by name; the first one is the organ.
    """

    reader: FloatArray
    patch: IntArray
    covariance: FloatArray
    parts: Mapping[str, slice]

    @property
    def organ(self) -> slice:
        """Rows of the organ."""
        return next(iter(self.parts.values()))

    @property
    def n_patches(self) -> int:
        """Number of patches, of whatever kind."""
        return int(self.patch.max()) + 1

    def left_out(self, models: Sequence[Linear]) -> list[FloatArray]:
        """For each model the residual (m,) mm of every row, predicted without its own patch; rows never left out are 0."""
        rows = [(self.reader @ m.r)[:, None] for m in models]
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
    """What an effect gains on data left out: rms before and after (mm, organ), and the gain per patch (mm2).

    share : of the mean square before. patches : how many.
    """

    before_mm: float
    after_mm: float
    mean_mm2: float
    share: float
    patches: int = 1


def gain(split: Split, before: FloatArray, after: FloatArray) -> Gain:
    """Compare two models by their residuals (m,) on data left out."""
    a, b = split.patch_means(before**2), split.patch_means(after**2)
    d, at = float((a - b).mean()), split.organ
    return Gain(rms(before[at]), rms(after[at]), d, d / max(float(a.mean()), 1e-30), len(a))


def predictive_p(split: Split, model: Linear, draws: int, seed: int = 1) -> float:
    """Posterior predictive p-value of a model on data left out (Gelman, Meng & Stern 1996): how often it would itself, true where it
    fits best, miss by as much what it predicts from the rest.

    The misses are squared in units of their own standard deviation under the model, and averaged over rows and patches.
    """
    rng = np.random.default_rng(seed)
    noise = np.linalg.cholesky(split.covariance) @ rng.standard_normal((len(split.covariance), draws))
    missed, (drawn,) = split.left_out([model])[0], split.predicted([model], [noise])
    rows = split.patch >= 0
    sd = np.sqrt(np.square(drawn).mean(axis=1))
    sizes = split.patch_means(np.square(np.column_stack([missed, drawn]) / np.where(rows, sd, 1.0)[:, None])).mean(
        axis=0
    )
    return float(np.mean(sizes >= sizes[0]))
