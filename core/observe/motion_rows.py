"""Rows of data that matched motion is: linear in the displacements of places, with one covariance of their errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import cholesky, qr, solve_triangular

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.matched_motion import MatchedMotion
from palpate.core.observe.contour_noise import noise_modes
from palpate.core.observe.motion_data import NUGGET, MotionData
from palpate.core.window_scores import WindowScores

# A window is no datum where more than this share of what it sees lies outside the mesh.
_OUTSIDE = 0.02
# Modes: correlation length of the motion that they hold, mm (that of a missing force, `NoiseModelOptions`; the motion that
# forces cause is smoother); share of its variance that is kept; the least signal over noise of one, and the most of them.
MOTION_LENGTH_MM, _KEPT, _LEAST, _MOST = 12.0, 0.999, 0.05, 300
# A motion is in the modes already where less than this share of what is seen of it is not.
_NEW = 1e-6


@dataclass(frozen=True, eq=False)
class MotionRows:
    """places : (w, 3) mm at rest about which rows look; place : (d,) that of each row. nodes : (p, 3) mm, whose displacements
    v (p, 3) mm rows are made of. response : (d, 3 p). value : (d,), what response @ v is for the motion seen. covariance :
    (d, d) of its errors."""

    places: FloatArray
    place: IntArray
    nodes: FloatArray
    response: sp.csr_matrix
    value: FloatArray
    covariance: FloatArray

    @classmethod
    def of(cls, matched: MatchedMotion, in_mesh: Callable[[FloatArray], BoolArray]) -> MotionRows:
        """The rows of a match in a mesh: of its windows' scores where it has them, else of its points' displacements."""
        if matched.scores is not None:
            return cls.of_scores(matched.scores, in_mesh(matched.scores.nodes))
        return cls.of_points(MotionData.of(matched, in_mesh(matched.points)))

    @classmethod
    def of_scores(cls, scores: WindowScores, inside: BoolArray) -> MotionRows:
        """inside (p,) : nodes that lie in the mesh."""
        seen = scores.of(scores.share_at(~inside) < _OUTSIDE)
        covariance = seen.covariance + NUGGET**2 * np.eye(len(seen.value))
        place = np.repeat(np.arange(len(seen.middles)), 3)
        return cls(seen.middles, place, seen.nodes, seen.response, seen.value, covariance)

    @classmethod
    def of_points(cls, data: MotionData) -> MotionRows:
        """Each row a component of one point's displacement."""
        d, p = len(data.sd), len(data.points)
        columns = (3 * data.point[:, None] + np.arange(3)).ravel()
        rows = np.repeat(np.arange(d), 3)
        response = sp.csr_matrix((data.direction.ravel(), (rows, columns)), shape=(d, 3 * p))
        return cls(data.points, data.point, data.points, response, data.components(data.moved), data.covariance())

    @classmethod
    def none(cls) -> MotionRows:
        """No data."""
        empty = np.zeros((0, 3))
        nowhere = np.zeros(0, dtype=np.int64)
        return cls(empty, nowhere, empty, sp.csr_matrix((0, 0)), np.zeros(0), np.zeros((0, 0)))

    @cached_property
    def as_a_whole(self) -> FloatArray:
        """Response (d, 3) to a displacement that is the same everywhere."""
        return np.stack([np.asarray(self.response[:, a::3].sum(axis=1)).ravel() for a in range(3)], axis=1)

    def predicted(self, v: FloatArray) -> FloatArray:
        """Values (d,) for displacements v (p, 3) mm of the nodes."""
        return np.asarray(self.response @ v.ravel())

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """For numpy.savez; `from_arrays` is the inverse."""
        parts = {"data": self.response.data, "columns": self.response.indices, "starts": self.response.indptr}
        whole = {k: getattr(self, k) for k in ("places", "place", "nodes", "value", "covariance")}
        return whole | {f"response/{key}": values for key, values in parts.items()}

    @classmethod
    def from_arrays(cls, data: Mapping[str, NDArray[np.generic]]) -> MotionRows:
        """Raises KeyError when an array is missing."""
        places, nodes, value, covariance = (
            np.asarray(data[k], dtype=np.float64) for k in ("places", "nodes", "value", "covariance")
        )
        place = np.asarray(data["place"], dtype=np.int64)
        parts = tuple(np.asarray(data[f"response/{k}"]) for k in ("data", "columns", "starts"))
        response = sp.csr_matrix(parts, shape=(len(value), 3 * len(nodes)))
        return cls(places, place, nodes, response, value, covariance)


def mode_reader(rows: MotionRows, shown: FloatArray | None = None) -> FloatArray:
    """Matrix (m, d) that takes data to modes of unit variance and independent errors, the best known first.

    A thousand windows are some hundred independent observations of a smooth motion. The data are whitened by their own
    covariance, and projected on the directions in which smooth motion of 1 mm shows most above their noise; the remainder
    is finer than any motion that forces cause. shown (d, k) : what the data show of motions of which nothing is to be lost,
    fine or not: a stiffer organ strains otherwise from its surface on.
    """
    if not len(rows.value):
        return np.zeros((0, 0))
    factor = cholesky(rows.covariance, lower=True)
    signal = solve_triangular(factor, _shown(rows, _smooth_motion(rows)), lower=True)
    square, turn = np.linalg.eigh(signal.T @ signal)
    kept = np.flatnonzero(square > _LEAST)[::-1][:_MOST]
    whole = signal @ (turn[:, kept] / np.sqrt(square[kept]))
    if shown is not None:
        whole = _with(whole, solve_triangular(factor, shown, lower=True))
    return np.asarray(solve_triangular(factor, whole, lower=True, trans="T").T)


def _with(whole: FloatArray, columns: FloatArray) -> FloatArray:
    """Orthonormal columns (d, m), and those (d, k) that further columns add to their span."""
    size = np.linalg.norm(columns, axis=0)
    left = columns - whole @ (whole.T @ columns)
    left -= whole @ (whole.T @ left)  # again, for what rounding leaves
    left = left[:, np.linalg.norm(left, axis=0) > _NEW * size]
    basis, triangle, _ = qr(left, mode="economic", pivoting=True)
    new = np.abs(np.diag(triangle))
    return np.hstack([whole, basis[:, : np.count_nonzero(new > _NEW * new.max(initial=0.0))]])


def motion_in_mm(rows: MotionRows, reader: FloatArray) -> FloatArray:
    """Matrix (w, 3, m) that takes modes (m,), read by `reader` (m, d), to the motion at the rows' places, mm.

    It is the mean of a smooth motion of 1 mm, as `mode_reader` takes it to be, given the modes (Rasmussen & Williams 2006): where
    nothing was seen it is 0.
    """
    smooth = _smooth_motion(rows)
    seen = reader @ _shown(rows, smooth)
    amplitudes = np.linalg.solve(np.eye(len(reader)) + seen @ seen.T, seen).T
    return np.einsum("wk,akm->wam", smooth, amplitudes.reshape(3, smooth.shape[1], len(reader)))


def _smooth_motion(rows: MotionRows) -> FloatArray:
    """Modes (w, k) mm of smooth motion along one axis, at the rows' places."""
    return noise_modes(rows.places, 1.0, MOTION_LENGTH_MM, _KEPT)


def _shown(rows: MotionRows, smooth: FloatArray) -> FloatArray:
    """What the rows show (d, 3 k) of modes (w, k) along each axis."""
    modes = smooth[rows.place]
    return np.concatenate([modes * rows.as_a_whole[:, a : a + 1] for a in range(3)], axis=1)
