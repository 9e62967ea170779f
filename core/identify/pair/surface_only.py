"""Inner motion of an organ whose surface is the only observation.

With unknown loads on its own surface an organ takes the observed shape at any stiffness, under proportional loads. The
stiffness is therefore not identifiable. The inner motion of one uniform body is computable; landmarks measure its
error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.space import Space
from palpate.core.forward.sliding_match import slide_onto
from palpate.core.identify.pair.rigid_pair import rigid_motion
from palpate.core.observe.surface_observation import sample_surface
from palpate.core.problem import SurfacePair
from palpate.core.statistics import rms
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.rigid_motion import transformed
from palpate.core.surfaces.triangle_tree import TriangleTree

# Motion models that are compared, the simplest first.
WAYS = ("still", "rigid", "affine", "model")
# Poisson's ratio of the uniform body. Nearer to 0.5 it cannot follow the volume difference of two imaging methods.
POISSON = 0.4
_ROUNDS, _STILL_MM = 60, 1e-4
# Spacing of the surface points, as a share of the surface's extent.
_SPACING = 0.06


@dataclass(frozen=True, eq=False)
class SurfaceAlone:
    """Motion of the uniform body and distances of every motion model.

    u : (n, 3) mm, nodal displacements. surface_mm : rms distance of the moved rest surface from the deformed one, by
    model. landmarks_mm : (k,) distance of each moved landmark from its observed position, by model.
    """

    u: FloatArray
    surface_mm: dict[str, float]
    landmarks_mm: dict[str, FloatArray]


def explain_surface(
    space: Space, faces: IntArray, pair: SurfacePair, landmarks: FloatArray, poisson_ratio: float = POISSON
) -> SurfaceAlone:
    """Motion of an organ by every model in WAYS, with residual distances.

    faces : (f, 3) of the organ's boundary. landmarks : (k, 6) mm, at rest and deformed. Raises ConvergenceError when
    the surfaces cannot be matched.
    """
    rigid = rigid_motion(pair)
    affine = affine_motion(pair, rigid)
    u = slide_onto(space, faces, pair, poisson_ratio=poisson_ratio)
    spacing = _SPACING * float(np.ptp(pair.rest.points, axis=0).max())
    points = sample_surface(pair.rest, spacing)[0]
    moved = _moved(points, rigid, affine, space, u)
    target = TriangleTree.of(pair.deformed.points, pair.deformed.faces)
    surface = {way: rms(closest_points(target, x).distance) for way, x in moved.items()}
    marks = _moved(landmarks[:, :3], rigid, affine, space, u) if len(landmarks) else {}
    return SurfaceAlone(u, surface, {w: np.linalg.norm(x - landmarks[:, 3:], axis=1) for w, x in marks.items()})


def affine_motion(pair: SurfacePair, start: FloatArray) -> FloatArray:
    """(4, 4) affine map of the rest surface onto the deformed one, by closest points, point to plane.

    start : (4, 4) map to start from. Components that the surfaces do not determine (rotation of a ball) stay as in
    `start`.
    """
    spacing = _SPACING * float(np.ptp(pair.rest.points, axis=0).max())
    points = sample_surface(pair.rest, spacing)[0]
    target = TriangleTree.of(pair.deformed.points, pair.deformed.faces)
    centre, scale = points.mean(axis=0), float(np.sqrt(points.var(axis=0).sum()))
    about = np.hstack([(points - centre) / scale, np.ones((len(points), 1))])
    matrix = start.copy()
    for _ in range(_ROUNDS):
        near = closest_points(target, transformed(matrix, points))
        normal = target.normals[near.triangle, near.part]
        normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        rows = (normal[:, :, None] * about[:, None, :]).reshape(len(points), 12)
        step = np.linalg.lstsq(rows, -near.signed, rcond=1e-3)[0].reshape(3, 4)
        matrix[:3, :3] += step[:, :3] / scale
        matrix[:3, 3] += step[:, 3] - step[:, :3] @ centre / scale
        if np.abs(step).max() < _STILL_MM:
            break
    return matrix


def _moved(x: FloatArray, rigid: FloatArray, affine: FloatArray, space: Space, u: FloatArray) -> dict[str, FloatArray]:
    ends = (x, transformed(rigid, x), transformed(affine, x), x + space.interpolation(x) @ u)
    return dict(zip(WAYS, ends, strict=True))
