"""Stationary random fields of any covariance, by circulant embedding (Dietrich & Newsam 1997)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import ndimage
from scipy.stats import norm, t

from palpate.core.arrays import FloatArray

Family = Literal["gaussian", "matern32", "exponential"]
Field = Callable[[FloatArray], FloatArray]

# Nodes of the field's grid to a correlation length; the spacing's limits, mm: what is finer is lost, what is coarser costs nothing more.
_NODES, _FINEST_MM, _COARSEST_MM = 3.0, 0.7, 2.5
# The field repeats itself beyond its box by so many of its longest lengths, where correlations have died away.
_PAD = 3.0


@dataclass(frozen=True)
class Part:
    """A part of a field: its share of the variance, the family of its covariance and its length, mm (l of exp(-d^2 / 2 l^2), of
    (1 + sqrt(3) d / l) exp(-sqrt(3) d / l), or of exp(-d / l))."""

    share: float
    family: Family
    length_mm: float

    def correlation(self, distance: FloatArray) -> FloatArray:
        """Correlation over a distance, mm."""
        d = distance / self.length_mm
        if self.family == "gaussian":
            return np.asarray(np.exp(-0.5 * d**2))
        if self.family == "exponential":
            return np.asarray(np.exp(-d))
        return np.asarray((1.0 + np.sqrt(3.0) * d) * np.exp(-np.sqrt(3.0) * d))


def correlation(parts: Sequence[Part], distance: FloatArray) -> FloatArray:
    """Correlation of the sum of `parts` over a distance, mm."""
    total = sum(part.share for part in parts)
    return np.asarray(sum(part.share / total * part.correlation(distance) for part in parts))


def random_vectors(
    parts: Sequence[Part],
    box: tuple[FloatArray, FloatArray],
    rng: np.random.Generator,
    axial: float = 1.0,
    freedom: float | None = None,
) -> Field:
    """A random vector field (n, 3) over a box, of unit variance along any direction; beyond the box as at its edge.

    axial : length along z over that across it. freedom : degrees of freedom of Student's t, which every component then follows at
    every point (more than 2; None: normal).
    """
    low, high = box
    lengths = [part.length_mm for part in parts]
    scale = np.array([1.0, 1.0, axial])
    step = np.clip(min(lengths) * scale / _NODES, _FINEST_MM, _COARSEST_MM)
    shape = np.ceil((high - low) / step).astype(int) + 2
    padded = np.array(
        [_even(int(s + np.ceil(_PAD * max(lengths) * a / h))) for s, a, h in zip(shape, scale, step, strict=True)]
    )
    offsets = [np.minimum(np.arange(n), n - np.arange(n)) * h / a for n, h, a in zip(padded, step, scale, strict=True)]
    distance = np.sqrt(sum(np.square(o) for o in np.meshgrid(*offsets, indexing="ij", sparse=True)))
    spectrum = np.sqrt(np.maximum(np.fft.rfftn(correlation(parts, distance)).real, 0.0))
    kept = tuple(slice(0, int(s)) for s in shape)
    components = []
    for _ in range(3):
        white = np.fft.rfftn(rng.standard_normal(tuple(padded)))
        values = np.fft.irfftn(spectrum * white, s=tuple(padded), axes=(0, 1, 2))[kept]
        components.append(values if freedom is None else _student(values, freedom))

    def at(points: FloatArray) -> FloatArray:
        index = ((points - low) / step).T
        return np.stack([ndimage.map_coordinates(c, index, order=1, mode="nearest") for c in components], axis=1)

    return at


def _even(n: int) -> int:
    """The next number without large factors, for the transform."""
    from scipy.fft import next_fast_len

    return int(next_fast_len(n, real=True))


def _student(values: FloatArray, freedom: float) -> FloatArray:
    """Normal values as Student's t of the same rank and variance."""
    return np.asarray(t.ppf(norm.cdf(values), freedom) * np.sqrt((freedom - 2.0) / freedom))
