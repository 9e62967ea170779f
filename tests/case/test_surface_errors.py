"""surface_errors.npz: what the segmentation says of its surfaces reaches the inference, unless somebody states another error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from triangle_shapes import ball

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.problem import facts_of, noise_source
from palpate.case.stated_files import ERRORS_FILE, further_files
from palpate.case.surface_errors import StatedErrors, write_surface_errors
from palpate.core.errors import InputError
from palpate.core.observe.contour_errors import ContourErrors
from palpate.core.problem import Facts, SurfacePair
from palpate.imaging.labels import RECTUM
from palpate.imaging.propagation.options import PropagationOptions
from palpate.imaging.volume import Volume
from palpate.segmentation.error_estimate import ErrorNumbers
from palpate.segmentation.surface_error import SurfaceErrors


@pytest.fixture
def case(tmp_path: Path) -> CaseFolder:
    """A case whose prostate was found in both scans, and whose bladder at rest alone."""
    made = CaseFolder.create(tmp_path / "case", CaseFacts("c"))
    surface = ball(10.0, (0.5, 0.0, 0.0))
    sd = np.where(surface.points[:, 0] > 0.0, 2.0, 1.0)
    found = SurfaceErrors(surface.points, sd, 0.8)
    write_surface_errors(made, {"rest": {"prostate": found, "bladder": found}, "deformed": {"prostate": found}})
    return made


def test_errors_lie_where_the_segmentation_put_them(case: CaseFolder) -> None:
    errors, surface = StatedErrors(case), ball(10.0, (0.5, 0.0, 0.0))
    moved = surface.with_points(1.02 * surface.points)
    pair = errors.pair(SurfacePair(moved, moved), "organ")
    assert pair.rest.sd_mm is not None and pair.common_share == ErrorNumbers().common_share
    np.testing.assert_array_equal(pair.rest.sd_mm, np.where(moved.points[:, 0] > 0.0, 2.0, 1.0))
    alone = errors.pair(SurfacePair(moved, moved), "bladder")
    assert alone.rest.sd_mm is not None and alone.deformed.sd_mm is None and alone.common_share == 0.0
    assert not errors.pair(SurfacePair(moved, moved), "rectum").states_errors
    assert set(errors.rms_mm()["rest"]) == {"organ", "bladder"}
    planned = errors.planned(SurfacePair(moved, moved), "bladder")
    assert planned.deformed.sd_mm is not None and planned.common_share == ErrorNumbers().common_share


def test_one_drawing_in_both_scans_errs_by_what_carried_it_over_alone(case: CaseFolder) -> None:
    surface = ball(10.0, (0.5, 0.0, 0.0))
    there = SurfaceErrors(surface.points, np.full(len(surface.points), 0.6), 1.0)
    write_surface_errors(case, {"deformed": {"prostate": there}}, ["prostate"])
    errors = StatedErrors(case)
    assert errors.correlation_mm == PropagationOptions().strain_length_mm
    pair = errors.pair(SurfacePair(surface, surface), "organ")
    seen = ContourErrors.of(pair, surface.points, surface.points, 0.4)
    np.testing.assert_allclose(np.diag(seen.covariance(seen, 10.0, True)), 0.36, rtol=0.02)
    planned = errors.planned(SurfacePair(surface, surface), "organ")
    assert planned.deformed.sd_mm is not None and planned.deformed.sd_mm.max() == 0.6


def test_an_organ_that_was_found_and_carried_over_errs_alike_in_both_scans(case: CaseFolder) -> None:
    labels = {state: Volume(np.full((6, 5, 4), 1, dtype=np.uint8), np.eye(4)) for state in STATES}
    for state in STATES:
        case.write_labels(state, labels[state])
    surface = ball(10.0, (0.5, 0.0, 0.0))
    found, there = (SurfaceErrors(surface.points, np.full(len(surface.points), sd), 0.8) for sd in (3.0, 0.4))
    write_surface_errors(
        case, {"rest": {"prostate": found}, "deformed": {"prostate": there}}, ["prostate"], labels, "rest"
    )
    errors, both = StatedErrors(case), SurfacePair(surface, surface)
    assert errors.found_automatically("rest", "organ") and not errors.shows_motion("organ")
    seen = ContourErrors.of(errors.pair(both, "organ"), surface.points, surface.points, 0.4)
    np.testing.assert_array_equal(seen.common, 3.0)
    np.testing.assert_allclose(seen.difference, 0.4)
    case.save_facts(replace(case.facts, boundary_noise_sd_mm=0.9))  # of contours: not of what carried one over
    seen = ContourErrors.of(StatedErrors(case).pair(both, "organ"), surface.points, surface.points, 0.9)
    np.testing.assert_allclose((seen.common[0, 0], seen.deformed[0]), (0.9, 0.4))
    case.save_facts(replace(case.facts, boundary_noise_sd_mm=None))
    labels["rest"].array[0, 0, 0] = 3
    case.write_labels("rest", labels["rest"])  # corrected: the other one errs as it was found
    pair = StatedErrors(case).pair(both, "organ")
    assert pair.deformed.sd_mm is not None and not pair.carried_to
    np.testing.assert_allclose(pair.deformed.sd_mm, np.hypot(3.0, 0.4))


def test_a_prostate_that_somebody_corrected_is_no_longer_one_drawing(case: CaseFolder) -> None:
    labels = {state: Volume(np.full((6, 5, 4), 3, dtype=np.uint8), np.eye(4)) for state in STATES}
    for state in STATES:
        labels[state].array[1:4, 1:4, 1:3] = 1
        case.write_labels(state, labels[state])
    there = SurfaceErrors(np.zeros((1, 3)), np.ones(1), 1.0)
    write_surface_errors(case, {"deformed": {"prostate": there}}, ["prostate"], labels)
    assert StatedErrors(case).one_drawing("organ")
    labels["deformed"].array[5, 4, 3] = RECTUM
    case.write_labels("deformed", labels["deformed"])
    assert StatedErrors(case).one_drawing("organ")  # another organ
    labels["deformed"].array[4, 2, 2] = 1
    case.write_labels("deformed", labels["deformed"])
    assert not StatedErrors(case).one_drawing("organ") and bool(StatedErrors(case))
    assert StatedErrors(case).shows_motion("organ")  # somebody looked at it there


def test_a_surface_that_nobody_drew_shows_no_motion_until_somebody_corrects_it(case: CaseFolder) -> None:
    labels = {state: Volume(np.full((6, 5, 4), 3, dtype=np.uint8), np.eye(4)) for state in STATES}
    for state in STATES:
        labels[state].array[1:4, 1:4, 1:3] = 1
        case.write_labels(state, labels[state])
    one = SurfaceErrors(np.zeros((1, 3)), np.ones(1), 1.0)
    write_surface_errors(case, {state: {"prostate": one} for state in STATES}, (), labels)
    assert not StatedErrors(case).shows_motion("organ")
    case.save_facts(replace(case.facts, boundary_noise_sd_mm=0.9))
    assert not StatedErrors(case).shows_motion("organ")  # an error that is stated draws nothing
    labels["rest"].array[4, 2, 2] = 1
    case.write_labels("rest", labels["rest"])
    assert not StatedErrors(case).shows_motion("organ")
    assert not StatedErrors(case).found_automatically("rest", "organ")
    labels["deformed"].array[4, 2, 2] = 1
    case.write_labels("deformed", labels["deformed"])
    assert StatedErrors(case).shows_motion("organ")
    write_surface_errors(case, {"rest": {"prostate": one}}, (), labels)
    assert StatedErrors(case).shows_motion("organ")  # drawn in the deformed scan


def test_the_drawn_one_of_a_single_drawing_was_not_found_automatically(case: CaseFolder) -> None:
    one = SurfaceErrors(np.zeros((1, 3)), np.ones(1), 1.0)
    write_surface_errors(case, {"rest": {"prostate": one}}, ["prostate"], None, "deformed")
    errors = StatedErrors(case)
    assert errors.found_automatically("rest", "organ") and not errors.found_automatically("deformed", "organ")
    assert not errors.shows_motion("organ")


def test_a_stated_or_measured_error_comes_first(case: CaseFolder) -> None:
    assert noise_source(case) == "image" and ERRORS_FILE in further_files(case)
    assert facts_of(case).noise_correlation_mm == ErrorNumbers().correlation_mm
    case.write_json("noise.json", {"sd_mm": 0.6, "correlation_mm": 6.0})
    assert noise_source(case) == "repeats" and not StatedErrors(case)
    assert (facts_of(case).noise_sd_mm, facts_of(case).noise_correlation_mm) == (0.6, 6.0)
    case.save_facts(replace(case.facts, boundary_noise_sd_mm=0.9))
    assert noise_source(case) == "case" and facts_of(case).noise_sd_mm == 0.9


def test_without_the_file_the_error_is_assumed(tmp_path: Path) -> None:
    case = CaseFolder.create(tmp_path / "bare", CaseFacts("c"))
    assert (
        noise_source(case) == "assumed" and facts_of(case).noise_sd_mm == Facts.noise_sd_mm and not StatedErrors(case)
    )
    write_surface_errors(case, {"rest": {}, "deformed": {}})
    assert noise_source(case) == "assumed" and not StatedErrors(case)


@pytest.mark.parametrize("sd", [np.nan, -1.0, 400.0])
def test_values_that_cannot_be_are_refused(case: CaseFolder, sd: float) -> None:
    case.write_npz(ERRORS_FILE, **{"rest/organ/points": np.zeros((1, 3)), "rest/organ/sd_mm": np.array([sd])})
    with pytest.raises(InputError, match=r"surface_errors\.npz: rest/organ/sd_mm holds values that cannot be"):
        StatedErrors(case)
