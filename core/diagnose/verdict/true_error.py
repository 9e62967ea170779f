"""What a model errs by in truth, where the data are a noisy drawing: posterior of its error at points left out.

A residual there is the model's error plus that of the organ's contours. The noise model has both: what walls, elements and parameters
may err by, a nameless gap of any size, and how wrong the drawing may be. The error given the residual is normal then (Rasmussen &
Williams 2006). To subtract the mean square of the drawing instead takes what the model errs by to nothing wherever the two
are alike, and calls every effect perfect.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from palpate.core.arrays import FloatArray
from palpate.core.inference.heldout import Linear, Split
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.joint_states import apart
from palpate.core.residual.noise_covariance import NoiseSizes, organ_noise
from palpate.core.residual.noise_estimation import NoiseGrid
from palpate.core.residual.plain_fit import PlainFit

# Pairs of sizes less probable than this, over the most probable one, are left out: a truncation.
_NEGLIGIBLE = 1e-3


@dataclass(frozen=True, eq=False)
class NoiseOfPoints:
    """What the residuals at the organ, m rows of a split, are made of, in a basis of all that the data can be there.

    basis (m, k) : orthonormal. reader (k, n) : takes the data vector to coordinates in it. noise : the probable sizes. free (n, j) mm :
    response of the data to a nameless gap of unit size. of_organ : covariance (n, n) mm2 of drawing and matching, for given sizes.
    """

    fit: PlainFit
    basis: FloatArray
    reader: FloatArray
    noise: NoiseGrid
    free: FloatArray
    of_organ: Callable[[NoiseSizes], FloatArray]

    @classmethod
    def of(cls, fit: PlainFit, split: Split, free: FloatArray) -> NoiseOfPoints:
        """free (n, j) mm : response of the data to a nameless gap, see `UnknownDiscrepancy`."""
        read = split.reader[split.organ]
        basis, _ = np.linalg.qr(read[:, read.any(axis=0)])
        plain = fit.linearisation
        drawn = organ_noise(plain.each, fit.model.data_vectors, fit.options, fit.shapes)
        matched = apart([matched_noise(data) for data in fit.model.data_vectors])
        return cls(fit, basis, basis.T @ read, fit.noise, free, lambda sizes: drawn(sizes) + matched)

    def error_of(self, model: Linear, left_out: FloatArray, gap_sizes: Sequence[float]) -> TrueError:
        """Posterior of a model's error where its residuals left_out (m,) mm were foretold.

        gap_sizes : of a nameless gap that the model leaves; 0 alone for a model that has such a gap among its parameters.
        """
        gaps = [size**2 * self.free @ self.free.T for size in gap_sizes]
        logs = np.stack([self.noise.log_likelihood(model.r, model.J, gap) + self.noise.log_prior for gap in gaps])
        weight = np.exp(logs - logs.max())
        likely = np.argwhere(weight > _NEGLIGIBLE)
        seen, known = self.basis.T @ left_out, self._of_parameters(model)
        nugget = self.fit.options.patch_nugget_mm**2 * np.eye(len(self.reader))
        parts, floors = [], []
        for which, size in likely:
            drawing = self.drawing(int(size))
            whole = self.reader @ (self.noise.covariances[int(size)] + gaps[which]) @ self.reader.T
            parts.append(error_given(whole - drawing + known, drawing + nugget, seen))
            floors.append(np.trace(drawing) / len(self.basis))
        weights = weight[tuple(likely.T)]
        return TrueError(weights / weights.sum(), parts, self.basis, np.array(floors))

    def drawing(self, size: int) -> FloatArray:
        """Covariance (k, k) mm2 of what the organ's contours err by, for one of the probable sizes."""
        return np.asarray(self.reader @ self.of_organ(self.noise.sizes[size]) @ self.reader.T)

    def _of_parameters(self, model: Linear) -> FloatArray:
        """Covariance (k, k) mm2 of what a model foretells, for what the data leave open of its parameters."""
        H = model.J.T @ self.fit.weighting.apply(model.J) + np.diag(model.precision)
        read = self.reader @ model.J
        return np.asarray(read @ np.linalg.solve(H, read.T))


@dataclass(frozen=True, eq=False)
class TrueError:
    """A mixture of normals in the coordinates of a basis (m, k): weights (w,), mean (k,) mm and a factor (k, k) of the covariance of
    each, and the mean square of the drawing's errors, mm2 (w,)."""

    weights: FloatArray
    parts: Sequence[tuple[FloatArray, FloatArray]]
    basis: FloatArray
    drawing: FloatArray

    def draws(self, count: int, rng: np.random.Generator) -> FloatArray:
        """(count, k) mm; their squares sum to those at the points."""
        out = []
        for number, (mean, factor) in zip(rng.multinomial(count, self.weights), self.parts, strict=True):
            out.append(mean + rng.standard_normal((number, factor.shape[1])) @ factor.T)
        return np.vstack(out)

    @property
    def floor_mm2(self) -> float:
        """Mean square of the drawing's errors."""
        return float(self.weights @ self.drawing)


def error_given(error: FloatArray, noise: FloatArray, seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean (m,) and a factor (m, m) of the covariance of an error, its prior covariance given, seen with noise (m, m)."""
    gain = cho_solve(cho_factor(error + noise, lower=True), error).T
    covariance = error - gain @ error
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    return gain @ seen, vectors * np.sqrt(np.maximum(values, 0.0))


def matched_noise(data: DataVector) -> FloatArray:
    """Covariance (n, n) of what the matching of a state's images errs by."""
    out = np.zeros((data.n, data.n))
    out[data.motion, data.motion] = data.motion_covariance
    return out
