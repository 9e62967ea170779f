"""Sums of fields in Gaussian windows about the nodes of a coarse lattice, axis by axis as small matrix products."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import Float32Array, FloatArray, IntArray
from palpate.imaging.volume import Volume

# A window ends at so many of its standard deviations.
TRUNCATE = 2.5
# Distance of the lattice's nodes over the windows' standard deviation: a field of windows' values is linear in between.
STEP = 0.8


@dataclass(frozen=True, eq=False)
class Windows:
    """Gaussian windows about the nodes (mi, mj, mk) of a lattice in a voxel grid (ni, nj, nk).

    sigma_mm : standard deviation. spacing : (3,) mm of the grid. weights : of each axis (m, n), a window's weights of the
    voxels. hats : of each axis (n, m), linear interpolation from nodes to voxels. axes : of each axis (m,) mm, the nodes from
    the first voxel. lattice : the nodes as an empty volume.
    """

    sigma_mm: float
    spacing: FloatArray
    weights: tuple[Float32Array, ...]
    hats: tuple[Float32Array, ...]
    axes: tuple[FloatArray, ...]
    lattice: Volume

    @classmethod
    def of(cls, grid: Volume, sigma_mm: float, step_mm: float | None = None) -> Windows:
        """Windows all over a grid, their nodes about `step_mm` apart."""
        step = STEP * sigma_mm if step_mm is None else step_mm
        places = [np.arange(n) * s for n, s in zip(grid.array.shape, grid.spacing, strict=True)]
        nodes = [_nodes(float(x[-1]), step) for x in places]
        weights = tuple(_gaussian(c, x, sigma_mm, s) for c, x, s in zip(nodes, places, grid.spacing, strict=True))
        hats = tuple(_linear(x, c) for c, x in zip(nodes, places, strict=True))
        affine = grid.affine.copy()
        affine[:3, 3] = grid.to_lps(np.array([[c[0] for c in nodes]]) / grid.spacing)[0]
        affine[:3, :3] = grid.affine[:3, :3] / grid.spacing * [c[1] - c[0] if len(c) > 1 else step for c in nodes]
        empty = np.zeros(tuple(len(c) for c in nodes), dtype=np.float32)
        return cls(sigma_mm, grid.spacing, weights, hats, tuple(nodes), Volume(empty, affine))

    @property
    def nodes(self) -> FloatArray:
        """Patient coordinates (mi, mj, mk, 3) mm of the nodes."""
        shape = self.lattice.array.shape
        index = np.moveaxis(np.indices(shape), 0, -1).reshape(-1, 3).astype(float)
        return self.lattice.to_lps(index).reshape(*shape, 3)

    @property
    def ends(self) -> tuple[tuple[IntArray, FloatArray], ...]:
        """Of each axis, the node (n,) below every voxel, and the weight (n,) of the one above it."""
        out = []
        for hats in self.hats:
            below = np.minimum(np.argmax(hats > 0.0, axis=1), max(hats.shape[1] - 2, 0))
            above = np.minimum(below + 1, hats.shape[1] - 1)
            out.append((below, hats[np.arange(len(hats)), above].astype(np.float64)))
        return tuple(out)

    def sum(self, field: Float32Array) -> Float32Array:
        """Weighted mean (mi, mj, mk) of a field (ni, nj, nk); weights add up to 1 away from the grid's faces."""
        return _contracted(field, self.weights)

    @property
    def independent_voxels(self) -> float:
        """The number of voxels whose plain mean is as sure as the window's weighted one."""
        return float((2.0 * np.sqrt(np.pi) * self.sigma_mm) ** 3 / np.prod(self.spacing))

    def sum_of_squared_weights(self, field: Float32Array) -> Float32Array:
        """The same with each weight squared: what a sum of independent errors of that variance has as its variance."""
        return _contracted(field, tuple(w * w for w in self.weights))

    def spread(self, values: FloatArray) -> Float32Array:
        """Values (mi, mj, mk) of the nodes at every voxel (ni, nj, nk), linear between nodes."""
        return _contracted(values.astype(np.float32), self.hats)

    def gathered(self, field: Float32Array) -> Float32Array:
        """Sums (mi, mj, mk) of a field (ni, nj, nk), every voxel's value shared among the nodes about it."""
        return _contracted(field, tuple(np.ascontiguousarray(h.T) for h in self.hats))

    def weights_at(self, places: tuple[FloatArray, ...]) -> tuple[Float32Array, ...]:
        """Of each axis (m, p), a window's weight at places (p,) mm from the first voxel, over what its voxels' add up to."""
        each = zip(self.axes, places, self.spacing, strict=True)
        return tuple(_gaussian(nodes, x, self.sigma_mm, s) for nodes, x, s in each)

    def mean_of_neighbours(self, values: FloatArray) -> FloatArray:
        """Values (mi, mj, mk) of the nodes averaged over a window (weights as those of the voxels in it)."""
        across = tuple((w @ h) for w, h in zip(self.weights, self.hats, strict=True))
        return np.asarray(_contracted(values.astype(np.float32), across), dtype=np.float64)


def pairs(count: int) -> list[tuple[int, int]]:
    """Index pairs (i, j), j >= i, of a symmetric matrix of that size."""
    return [(i, j) for i in range(count) for j in range(i, count)]


def symmetric(parts: dict[tuple[int, int], Float32Array], count: int) -> FloatArray:
    """Matrices (..., count, count) from their upper parts (...)."""
    first = next(iter(parts.values()))
    out = np.empty((*first.shape, count, count))
    for (i, j), values in parts.items():
        out[..., i, j] = out[..., j, i] = values
    return out


def _nodes(length: float, step: float) -> FloatArray:
    count = int(length / step) + 1
    return np.asarray((length - (count - 1) * step) / 2.0 + step * np.arange(count), dtype=np.float64)


def _gaussian(nodes: FloatArray, places: FloatArray, sigma: float, spacing: float) -> Float32Array:
    away = (places[None, :] - nodes[:, None]) / sigma
    weight = np.where(np.abs(away) <= TRUNCATE, np.exp(-0.5 * away**2), 0.0)
    lags = np.arange(-np.ceil(TRUNCATE * sigma / spacing), np.ceil(TRUNCATE * sigma / spacing) + 1) * spacing / sigma
    whole = np.exp(-0.5 * lags[np.abs(lags) <= TRUNCATE] ** 2).sum()
    return np.asarray(weight / whole, dtype=np.float32)


def _linear(places: FloatArray, nodes: FloatArray) -> Float32Array:
    eye = np.eye(len(nodes))
    return np.stack([np.interp(places, nodes, row) for row in eye], axis=1).astype(np.float32)


def _contracted(field: Float32Array, matrices: tuple[Float32Array, ...]) -> Float32Array:
    """A field multiplied by one matrix along each axis."""
    out = field
    for axis in (2, 1, 0):
        out = np.moveaxis(np.tensordot(out, matrices[axis], axes=(axis, 1)), -1, axis)
    return np.ascontiguousarray(out)
