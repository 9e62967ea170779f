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

    def covariances(self, other: VoxelNoise, length_mm: float) -> tuple[FloatArray, FloatArray]:
        """Covariances (p, q) mm2 of the errors at rest and of those in the deformed scan, between these points and another
        state's.

        Few draws see correlation between distant points where there is none. The sample covariance is multiplied by a
        Gaussian of the distance, as ensemble filters do (Houtekamer & Mitchell 2001).
        """
        near = np.exp(-0.5 * (cdist(self.points, other.points) / length_mm) ** 2)
        return _sample(self.rest, other.rest) * near, _sample(self.deformed, other.deformed) * near


def voxel_covariance(
    noise: Sequence[VoxelNoise],
    responses: Sequence[tuple[FloatArray, FloatArray]],
    rows: Sequence[slice],
    n: int,
    length_mm: float,
) -> FloatArray:
    """Covariance (n, n) mm2 of all data for the voxels of one body, in the states that show it.

    responses (n_s, q) : of the data of each of them, which stand in its rows, per mm outwards at each point, of the surface at
    rest and, with the other sign, of the deformed one. Deformed states have the scan at rest in common.
    """
    out = np.zeros((n, n))
    for s, (ours, (mine, deformed)) in enumerate(zip(noise, responses, strict=True)):
        for t, (theirs, (other, _)) in enumerate(zip(noise[: s + 1], responses, strict=False)):
            at_rest, alone = ours.covariances(theirs, length_mm)
            block = mine @ at_rest @ other.T
            out[rows[s], rows[t]] = block + deformed @ alone @ deformed.T if s == t else block
            out[rows[t], rows[s]] = out[rows[s], rows[t]].T
    return out


def _at(surface: Surface, points: FloatArray) -> FloatArray:
    """Draws (m, q) mm at the surface's vertex nearest to each point (q, 3) mm."""
    if surface.voxel_errors is None:
        return np.zeros((0, len(points)))
    return np.asarray(surface.voxel_errors[:, cKDTree(surface.points).query(points)[1]], dtype=np.float64)


def _sample(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a.T @ b) / max(len(a), 1)
