"""Mean stiffness of a region of the map, with its interval: what a region that a person draws on the map holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.identify.map.stiffness_map import nearest_patch, painted

# Of the file of the map, where it holds it: (n, n) covariance of ln G of the patches.
COVARIANCE = "covariance"
_NORMAL_95 = 1.96


@dataclass(frozen=True)
class RegionMean:
    """Mean shear modulus over the part of a region that the map tells.

    G_kpa : arithmetic mean; None where the scans tell no part. interval_kpa : 95 % of it. told_share : 0 to 1.
    """

    G_kpa: float | None
    interval_kpa: tuple[float, float] | None
    told_share: float


def region_mean(
    arrays: Mapping[str, NDArray[np.generic]], points: FloatArray, labels: IntArray | None = None
) -> RegionMean:
    """Mean over points (p, 3) mm, with labels (p,) of their halves, that lie evenly in a region of the organ.

    arrays : of `StiffnessMap.arrays`. The interval is that of ln(mean G) by the delta method: with the covariance of
    the patches where the file holds it. Where it holds their standard deviations only, patches are taken as fully
    correlated, which is the widest that these allow.
    """
    if not len(points):
        return RegionMean(None, None, 0.0)
    G, told = painted(arrays, points, labels)
    if not told.any():
        return RegionMean(None, None, 0.0)
    mean = float(G[told].mean())
    spread = float(np.exp(_NORMAL_95 * _sd_of_ln_mean(arrays, nearest_patch(arrays, points, labels)[told], G[told])))
    return RegionMean(mean, (mean / spread, mean * spread), float(told.mean()))


def _sd_of_ln_mean(arrays: Mapping[str, NDArray[np.generic]], patch: IntArray, G: FloatArray) -> float:
    """Standard deviation of ln(mean G) over points whose values are G (p,), in the patches patch (p,)."""
    weights = np.bincount(patch, G / G.sum(), len(np.asarray(arrays["sd"])))
    if COVARIANCE in arrays:
        return float(np.sqrt(weights @ np.asarray(arrays[COVARIANCE], dtype=float) @ weights))
    return float(weights @ np.asarray(arrays["sd"], dtype=float))
