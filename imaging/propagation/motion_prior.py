"""What motion of tissue is likely before the images are asked: a Gaussian process, of which windows' motions are samples.

Three parts: all tissue moves together over an organ's size; the wall of a hollow organ moves along its normal as it
fills or empties, and that fades into the tissue; tissue strains locally. The local part has the strain of pairs that tell
a stiffness. It is what is not known where the images show nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.imaging.propagation.options import PropagationOptions

# Neighbours on a wall whose normals are averaged, and the width of their weights, mm.
_ASKED, _WIDTH_MM = 8, 2.0


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points (n, 3) mm of an organ's surface and unit normals (n, 3) outward."""

    points: FloatArray
    normals: FloatArray


@dataclass(frozen=True, eq=False)
class Walls:
    """Surfaces of the hollow organs, asked for what a wall's normal motion does at other points."""

    surfaces: Sequence[SurfacePoints]
    fade_mm: float
    _trees: list[cKDTree] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_trees", [cKDTree(surface.points) for surface in self.surfaces])

    def carried(self, points: FloatArray) -> list[FloatArray]:
        """Of each wall, the displacement (n, 3) at points (n, 3) mm that a unit of its normal motion causes."""
        out = []
        for surface, tree in zip(self.surfaces, self._trees, strict=True):
            k = min(_ASKED, len(surface.points))
            away, near = (found.reshape(len(points), k) for found in tree.query(points, k=k))
            weight = np.exp(-0.5 * ((away - away[:, :1]) / _WIDTH_MM) ** 2)
            normal = np.einsum("nk,nka->na", weight, surface.normals[near])
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
            out.append(normal * np.exp(-away[:, :1] / self.fade_mm))
        return out


@dataclass(frozen=True)
class Sizes:
    """Standard deviations, mm: of the motion of all tissue, and of each wall."""

    far_mm: float
    walls_mm: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class MotionPrior:
    """Covariances of displacements under given sizes."""

    walls: Walls
    sizes: Sizes
    options: PropagationOptions

    @property
    def local_mm(self) -> float:
        """Standard deviation of the local part: a Matern 3/2 field of length l and this size strains by size sqrt(3) / l."""
        return self.options.strain * self.options.strain_length_mm / np.sqrt(3.0)

    @property
    def variances(self) -> FloatArray:
        """Variances (2 + walls,) mm2 of the parts: motion of all tissue, local motion, each wall."""
        return np.array([self.sizes.far_mm, self.local_mm, *self.sizes.walls_mm]) ** 2

    def along(
        self, points: FloatArray, directions: FloatArray, others: FloatArray, other_directions: FloatArray
    ) -> FloatArray:
        """Covariance (n, m) mm2 of displacements at points (n, 3) mm along directions, and at others (m, 3) along theirs."""
        out = np.zeros((len(points), len(others)))
        parts = self.parts(points, directions, others, other_directions)
        for variance, part in zip(self.variances, parts, strict=False):
            if variance > 0.0:
                out += variance * part
        return out

    def parts(
        self, points: FloatArray, directions: FloatArray, others: FloatArray, other_directions: FloatArray
    ) -> Iterator[FloatArray]:
        """The same (n, m) of each part, of unit variance; walls are not asked for where none moves."""
        apart, alike = cdist(points, others), directions @ other_directions.T
        yield alike * matern(apart, self.options.far_length_mm)
        yield alike * matern(apart, self.options.strain_length_mm)
        if not any(self.sizes.walls_mm):
            return
        of_walls = matern(apart, self.options.wall_length_mm)
        for a, b in zip(self.walls.carried(points), self.walls.carried(others), strict=True):
            yield np.outer((a * directions).sum(axis=1), (b * other_directions).sum(axis=1)) * of_walls

    def variance(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        """Variance (n,) mm2 of displacements along directions."""
        out = np.full(len(points), self.sizes.far_mm**2 + self.local_mm**2)
        for size, a in zip(self.sizes.walls_mm, self.walls.carried(points), strict=True):
            out += size**2 * np.einsum("na,na->n", a, directions) ** 2
        return out

    def applied(
        self, points: FloatArray, others: FloatArray, directions: FloatArray, weights: FloatArray
    ) -> FloatArray:
        """Displacements (n, 3) mm: covariance with those at others (m, 3) along directions, times weights (m,)."""
        apart = cdist(points, others)
        out = self._even(apart) @ (directions * weights[:, None])
        ours, theirs = self.walls.carried(points), self.walls.carried(others)
        alike = self._of_walls(apart)
        for size, a, b in zip(self.sizes.walls_mm, ours, theirs, strict=True):
            if size > 0.0:
                share = np.einsum("na,na->n", b, directions) * weights
                out += size**2 * a * (alike @ share)[:, None]
        return np.asarray(out)

    def _of_walls(self, apart: FloatArray) -> FloatArray:
        """Correlation of a wall's normal motions at distances, the same for all walls; not computed where none moves."""
        moves = any(size > 0.0 for size in self.sizes.walls_mm)
        return matern(apart, self.options.wall_length_mm) if moves else np.zeros((0, 0))

    def _even(self, apart: FloatArray) -> FloatArray:
        o = self.options
        return self.sizes.far_mm**2 * matern(apart, o.far_length_mm) + self.local_mm**2 * matern(
            apart, o.strain_length_mm
        )


def matern(apart: FloatArray, length_mm: float) -> FloatArray:
    """Correlation at distances, mm, of a Matern 3/2 field (Rasmussen and Williams 2006, Eq 4.17)."""
    r = np.sqrt(3.0) * apart
    r /= length_mm
    fading = np.exp(-r)
    # In place: large new arrays cost as much as the exponential.
    r += 1.0
    r *= fading
    return np.asarray(r)
