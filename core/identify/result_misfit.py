"""Distances between the predicted and the observed deformed organ, for result.json (Eqs 10 to 13 of Yang & Lin)."""

from __future__ import annotations

import numpy as np
from msgspec import UNSET

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.identify.result_record import MisfitRecord
from palpate.core.problem import IdentificationProblem
from palpate.core.surfaces.surface_distance import surface_misfit
from palpate.core.surfaces.triangle_tree import TriangleTree


def misfit_figures(
    problem: IdentificationProblem, points: FloatArray, region: IntArray, moved: FloatArray
) -> MisfitRecord:
    """Distances, mm, of the moved points from the deformed surface of their own region.

    points : (q, 3) mm, organ surface at rest; rms_before_mm is their own distance. region : (q,) of each point; points
    of an unobserved region are left out. moved : (q, 3) mm, points after the motion. Two contours of which one was carried
    over have no error of one contour.
    """
    deformed = problem.organ.deformed
    targets = {
        r: TriangleTree.of(deformed.points, deformed.faces[deformed.region == r])
        for r in problem.regions
        if (deformed.region == r).any()
    }
    observed = np.isin(region, list(targets))
    start, end = (surface_misfit(x[observed], region[observed], targets) for x in (points, moved))
    return MisfitRecord(
        rms_mm=end.rms_mm,
        p95_mm=end.p95_mm,
        hausdorff_mm=end.hausdorff_mm,
        objective_mm2=end.objective_mm2,
        points=end.points,
        rms_before_mm=start.rms_mm,
        contour_noise_sd_mm=UNSET if problem.organ.carried_to else problem.organ_noise_mm,
    )
