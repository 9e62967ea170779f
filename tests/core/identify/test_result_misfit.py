"""Figures of misfit in result.json."""

from __future__ import annotations

from dataclasses import replace

import synthetic_case

from palpate.core.files.json_types import known
from palpate.core.identify.result_misfit import misfit_figures


def test_two_contours_of_which_one_was_carried_over_have_no_error_of_one() -> None:
    exact = synthetic_case.problem()
    carried = replace(exact, organ=replace(exact.organ, carried_to="deformed"))
    points = exact.organ.rest.points
    region = exact.organ.rest.region[:1].repeat(len(points))
    drawn, over = (misfit_figures(problem, points, region, points) for problem in (exact, carried))
    assert known(drawn.contour_noise_sd_mm) == exact.organ_noise_mm
    assert known(over.contour_noise_sd_mm) is None and over.rms_mm == drawn.rms_mm
