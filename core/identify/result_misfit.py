"""The figures of result.json that say how well the organ meets the deformed scan (Eqs 10 to 13 of Yang & Lin)."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.identify.result_record import MisfitRecord
from palpate.core.problem import IdentificationProblem
from palpate.core.surfaces.surface_distance import surface_misfit
from palpate.core.surfaces.triangle_tree import TriangleTree


def misfit_figures(
    problem: IdentificationProblem, points: FloatArray, region: IntArray, moved: FloatArray
) -> MisfitRecord:
    """Distances, mm, of points (q, 3) of the organ's surface after they moved to `moved` (q, 3), every point to its own region's
    surface; rms_before_mm is that of `points` themselves. region : (q,) of each; points of one that is not seen are left out.
    """
    deformed = problem.organ.deformed
    targets = {
        r: TriangleTree.of(deformed.points, deformed.faces[deformed.region == r])
        for r in problem.regions
        if (deformed.region == r).any()
    }
    seen = np.isin(region, list(targets))
    start, end = (surface_misfit(x[seen], region[seen], targets) for x in (points, moved))
    return MisfitRecord(
        rms_mm=end.rms_mm,
        p95_mm=end.p95_mm,
        hausdorff_mm=end.hausdorff_mm,
        objective_mm2=end.objective_mm2,
        points=end.points,
        rms_before_mm=start.rms_mm,
        contour_noise_sd_mm=problem.facts.noise_sd_mm,
    )
