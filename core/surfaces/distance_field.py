"""Signed distance of a surface as a smooth function of space: sampled on a grid, interpolated by cubic B-splines.

The interpolant has continuous second derivatives and its gradient is exactly the derivative of its value, so that Newton
converges on it; a distance taken straight from triangles has neither.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_banded

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.spline_kernels import evaluate
from palpate.core.surfaces.triangle_tree import TriangleTree

# Far from the surface every third grid point is exact and the others follow by splines: 27 times less work.
_STRIDE = 3
_MOST_GRID_POINTS = 30_000_000
# Surfaces whose fields are kept: those of a case, which every element, reduced model and refit asks for anew.
_KEPT = 8


@dataclass(frozen=True, eq=False)
class SignedDistanceField:
    """d(x) mm, positive outside, by tricubic B-splines; beyond the grid it goes on along straight lines.

    coefficients : (nx + 2, ny + 2, nz + 2) of the splines centred on the grid points and one more around.
    origin : (3,) mm, first grid point. spacing : mm.
    """

    coefficients: FloatArray
    origin: FloatArray
    spacing: float

    @classmethod
    def from_surface(
        cls,
        points: FloatArray,
        faces: IntArray,
        spacing_mm: float = 1.0,
        margin_mm: float = 12.0,
        box: FloatArray | None = None,
        band_mm: float = 5.0,
    ) -> SignedDistanceField:
        """Field of the surface points (n, 3) mm, faces (f, 3) with outward normals, on its bounding box plus a margin,
        or on `box` (2, 3) mm.

        Grid values are exact where |d| < band_mm; beyond they are interpolated from a grid three times as coarse (error
        about 0.01 mm where the distance is smooth). An open surface is carried on along its rim's tangent planes, so that the
        sign has no jump beyond the rim. Raises InputError for an invalid surface or a grid too large for memory.
        """
        tree = TriangleTree.of(points, faces)
        low, high = box if box is not None else (points.min(axis=0) - margin_mm, points.max(axis=0) + margin_mm)
        low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
        coarse = np.maximum(np.ceil((high - low) / (_STRIDE * spacing_mm) - 1e-9), 1.0).astype(np.int64) + 1
        if np.prod((coarse - 1) * _STRIDE + 1, dtype=np.float64) > _MOST_GRID_POINTS:
            raise InputError(f"a surface of {np.round(high - low)} mm is too large for a {spacing_mm} mm distance grid")
        made_from = hashlib.sha256(repr((spacing_mm, band_mm, low.tolist(), high.tolist(), points.shape)).encode())
        made_from.update(np.asarray(points).tobytes())
        made_from.update(np.asarray(faces).tobytes())
        return _kept(
            made_from.digest(),
            lambda: cls.from_samples(_sample(tree, low, coarse, spacing_mm, band_mm), low, spacing_mm),
        )

    @classmethod
    def from_samples(cls, samples: FloatArray, origin: FloatArray, spacing_mm: float) -> SignedDistanceField:
        """Interpolate samples (nx, ny, nz), each at least 2, at origin + spacing * index."""
        c = np.asarray(samples, dtype=np.float64)
        for axis in range(3):
            c = np.moveaxis(_natural_coefficients(np.moveaxis(c, axis, 0)), 0, axis)
        return cls(np.ascontiguousarray(c), np.array(origin, dtype=np.float64), float(spacing_mm))

    def value_and_gradient(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """d (q,) mm and its gradient (q, 3) at x (q, 3) mm. Not a number where x is not."""
        x, value, gradient = _prepare(x)
        evaluate(self.coefficients, self.origin, 1.0 / self.spacing, x, value, gradient, np.empty((0, 3, 3)))
        return value, gradient

    def hessian(self, x: FloatArray) -> FloatArray:
        """Second derivatives (q, 3, 3) 1/mm at x (q, 3) mm."""
        x, value, gradient = _prepare(x)
        second = np.empty((len(x), 3, 3))
        evaluate(self.coefficients, self.origin, 1.0 / self.spacing, x, value, gradient, second)
        return second

    def arrays(self) -> dict[str, FloatArray]:
        """For numpy.savez; `from_arrays` is the inverse."""
        return {"coefficients": self.coefficients, "origin": self.origin, "spacing": np.array(self.spacing)}

    @classmethod
    def from_arrays(cls, data: Mapping[str, NDArray[np.generic]]) -> SignedDistanceField:
        """The field that `arrays` described."""
        c, origin, spacing = (np.asarray(data[k], dtype=np.float64) for k in ("coefficients", "origin", "spacing"))
        return cls(np.ascontiguousarray(c), origin, float(spacing))


_FIELDS: OrderedDict[bytes, SignedDistanceField] = OrderedDict()


def _kept(key: bytes, make: Callable[[], SignedDistanceField]) -> SignedDistanceField:
    """The field that was made under a key before, or a new one; the one that was asked for longest ago is dropped."""
    field = _FIELDS.pop(key, None) or make()
    _FIELDS[key] = field
    while len(_FIELDS) > _KEPT:
        _FIELDS.popitem(last=False)
    return field


def signed_distance(tree: TriangleTree, x: FloatArray) -> FloatArray:
    """Exact signed distance (q,) mm at x (q, 3); beyond an open surface's rim, the distance from its tangent plane."""
    closest = closest_points(tree, x)
    d = closest.signed.copy()
    beyond = np.flatnonzero(tree.rim[closest.triangle, closest.part])
    corner = tree.normals[closest.triangle[beyond], 1:4]
    corner = corner / np.maximum(np.linalg.norm(corner, axis=2, keepdims=True), 1e-300)
    normal = np.einsum("qk,qki->qi", closest.barycentric[beyond], corner)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    d[beyond] = np.einsum("qi,qi->q", np.asarray(x)[beyond] - closest.point[beyond], normal)
    return d


def _sample(tree: TriangleTree, low: FloatArray, coarse: IntArray, h: float, band: float) -> FloatArray:
    """Distances on the grid of (coarse - 1) * stride + 1 points a side."""
    far = signed_distance(tree, low + _STRIDE * h * _indices(coarse)).reshape(coarse)
    fine = (coarse - 1) * _STRIDE + 1
    values = far
    for axis in range(3):
        at = np.arange(coarse[axis], dtype=np.float64)
        spline = CubicSpline(at, values, axis=axis, bc_type="natural" if len(at) > 2 else "not-a-knot")
        values = spline(np.arange(fine[axis]) / _STRIDE)
    # A fine point is at most sqrt(3) spacings from a coarse one, and a distance changes no faster than its point moves.
    nearest = np.abs(far)[np.ix_(*((np.arange(n) + _STRIDE // 2) // _STRIDE for n in fine))]
    near = np.argwhere(nearest < band + np.sqrt(3.0) * h)
    values = np.ascontiguousarray(values)
    values[tuple(near.T)] = signed_distance(tree, low + h * near)
    return values


def _indices(shape: IntArray) -> FloatArray:
    return np.stack(np.meshgrid(*(np.arange(n, dtype=np.float64) for n in shape), indexing="ij"), axis=-1).reshape(
        -1, 3
    )


def _natural_coefficients(samples: FloatArray) -> FloatArray:
    """Cubic B-spline coefficients (n + 2, ...) that interpolate samples (n, ...) with no second derivative at the ends.

    Mirrored ends, the usual choice for pictures, would bend the field flat at the grid's faces.
    """
    n = len(samples)
    band = np.zeros((3, n))
    band[0, 2:], band[1, :], band[2, :-2] = 1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0
    band[1, 0] = band[1, -1] = 1.0
    inner = solve_banded((1, 1), band, samples.reshape(n, -1)).reshape(samples.shape)
    return np.concatenate([2.0 * inner[:1] - inner[1:2], inner, 2.0 * inner[-1:] - inner[-2:-1]])


def _prepare(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    x = np.ascontiguousarray(x, dtype=np.float64).reshape(-1, 3)
    return x, np.empty(len(x)), np.empty((len(x), 3))
