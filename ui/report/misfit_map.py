"""The misfit of an identified case on the organ, at the points that the figures of result.json are of."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from palpate.case.case_folder import CaseFolder
from palpate.case.meshed import ORGAN_NAME, load_surfaces
from palpate.core.arrays import FloatArray
from palpate.ui.pictures.offscreen import polydata
from palpate.ui.pictures.solids import MisfitMap

# Points lie some two millimetres apart: a mean over about that shows every patch of theirs and no facets.
_NEAREST, _REACH_MM = 16, 2.0


def misfit_map(case: CaseFolder, noise_mm: float | None) -> MisfitMap:
    """The organ's smooth surface moved as identified, and the signed distance from the deformed scan's surface.

    The distance is that of the points at which the surface was compared, so that a picture shows what the table says: the
    corners of the mesh lie up to two millimetres off a surface that bends between them.
    """
    fields = case.read_npz("identify/fields.npz")
    at, move = fields["surface_points"], fields["surface_displacement"]
    target = load_surfaces(case, "deformed")[ORGAN_NAME]
    seen = polydata(target.points, target.faces)
    distance = np.asarray(
        polydata(at + move, np.zeros((0, 3), dtype=np.int64)).compute_implicit_distance(seen)["implicit_distance"]
    )
    organ = load_surfaces(case, "rest")[ORGAN_NAME]
    spread = _spread(at, np.column_stack([move, distance]), organ.points)
    return MisfitMap(organ.points + spread[:, :3], organ.faces, spread[:, 3], noise_mm, float(np.abs(distance).max()))


def _spread(at: FloatArray, values: FloatArray, points: FloatArray) -> FloatArray:
    """Values (q, k) at places (q, 3) carried to points (n, 3): means of the nearest, weighed by their distance."""
    count = min(_NEAREST, len(at))
    far, near = cKDTree(at).query(points, k=range(1, count + 1))
    weight = 1.0 / (far**2 + _REACH_MM**2)
    weight /= weight.sum(axis=1, keepdims=True)
    return np.asarray((weight[:, :, None] * values[near]).sum(axis=1), dtype=np.float64)
