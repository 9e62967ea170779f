"""Covariance of the error that voxels make in a body's two surfaces, from the draws that the surfaces carry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.core.problem import SurfacePair
from palpate.core.surfaces.surface import Surface


@dataclass(frozen=True, eq=False)
class VoxelNoise:
    """points (q, 3) mm at rest. rest, deformed (m, q) mm : draws of both surfaces' errors there; no draws (0, q) of a surface
    that comes from no label."""

    points: FloatArray
    rest: FloatArray
    deformed: FloatArray

    @classmethod
    def of(cls, pair: SurfacePair, points: FloatArray, moved: FloatArray) -> VoxelNoise:
        """At points (q, 3) mm of the rest surface that lie at `moved` (q, 3) mm in the deformed scan."""
        return cls(points, _at(pair.rest, points), _at(pair.deformed, moved))

    def covariance(self, other: VoxelNoise, same_state: bool, length_mm: float) -> FloatArray:
        """Covariance (p, q) mm2 between these points and another state's. same_state : False for two deformed states, which
        have the scan at rest in common.

        Few draws see correlation between distant points where there is none. The sample covariance is multiplied by a
        Gaussian of the distance, as ensemble filters do (Houtekamer & Mitchell 2001).
        """
        sample = _sample(self.rest, other.rest)
        if same_state:
            sample = sample + _sample(self.deformed, other.deformed)
        return sample * np.exp(-0.5 * (cdist(self.points, other.points) / length_mm) ** 2)


def voxel_covariance(
    noise: Sequence[VoxelNoise], responses: Sequence[FloatArray], rows: Sequence[slice], n: int, length_mm: float
) -> FloatArray:
    """Covariance (n, n) mm2 of all data for the voxels of one body, in the states that show it.

    responses (n_s, q) : of the data of each of them, which stand in its rows, per mm outwards at each point.
    """
    out = np.zeros((n, n))
    for s, (ours, mine) in enumerate(zip(noise, responses, strict=True)):
        for t, (theirs, other) in enumerate(zip(noise[: s + 1], responses, strict=False)):
            out[rows[s], rows[t]] = mine @ ours.covariance(theirs, s == t, length_mm) @ other.T
            out[rows[t], rows[s]] = out[rows[s], rows[t]].T
    return out


def _at(surface: Surface, points: FloatArray) -> FloatArray:
    """Draws (m, q) mm at the surface's vertex nearest to each point (q, 3) mm."""
    if surface.voxel_errors is None:
        return np.zeros((0, len(points)))
    return np.asarray(surface.voxel_errors[:, cKDTree(surface.points).query(points)[1]], dtype=np.float64)


def _sample(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a.T @ b) / max(len(a), 1)
