"""The contours' error measured from an organ drawn twice."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_body import body

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.measured_noise import measured_noise
from palpate.case.problem import facts_of
from palpate.case.steps import measure_contour_noise
from palpate.core.errors import InputError
from palpate.core.observe.contour_noise import EXTRACTION_LENGTH_MM, EXTRACTION_MM, matern_3_2, smooth_covariance
from palpate.core.observe.repeat_contours import repeat_of
from palpate.core.problem import Facts
from palpate.core.surfaces.surface import Surface
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.ui.cli.commands import identify


def ball(radius: float = 20.0, level: int = 18) -> Surface:
    """A sphere as triangles between circles of latitude."""
    theta, phi = np.meshgrid(
        np.linspace(0.03, np.pi - 0.03, level), np.arange(2 * level) * np.pi / level, indexing="ij"
    )
    normal = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    index = np.arange(level * 2 * level).reshape(level, 2 * level)
    a, b = index[:-1], index[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return Surface(radius * normal.reshape(-1, 3), faces, np.ones(len(faces), dtype=np.int64))


@pytest.mark.parametrize(("sd", "length"), [(0.4, 5.0), (0.8, 8.0)])
def test_what_a_person_errs_by_and_over_what_length_is_found(sd: float, length: float) -> None:
    truth, rng, found = ball(), np.random.default_rng(5), []
    normal = truth.points / np.linalg.norm(truth.points, axis=1, keepdims=True)
    apart = np.linalg.norm(truth.points[:, None] - truth.points[None], axis=2)
    each = smooth_covariance(truth.points, sd, length) + 0.5 * EXTRACTION_MM**2 * matern_3_2(
        apart, EXTRACTION_LENGTH_MM
    )
    values, vectors = np.linalg.eigh(each)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    for _ in range(4):
        one, other = (
            replace(truth, points=truth.points + (root @ rng.standard_normal(len(root)))[:, None] * normal)
            for _ in "ab"
        )
        found.append(repeat_of(one, other))
    assert np.mean([r.sd_mm for r in found]) == pytest.approx(sd, rel=0.15)
    assert np.median([r.correlation_mm for r in found]) == pytest.approx(length, rel=0.3)


def test_two_organs_are_not_two_drawings_of_one() -> None:
    with pytest.raises(InputError, match=r"6\.0 mm apart; give the same organ drawn twice"):
        repeat_of(ball(20.0), ball(26.0))


def test_a_case_goes_by_what_was_measured_unless_it_states_its_own(tmp_path: Path) -> None:
    case = CaseFolder.create(tmp_path / "case", CaseFacts("made-up"))
    labels = body()
    case.write_labels("rest", labels)
    shifted = np.eye(4)
    shifted[:3, 3] = [1.0, 0.0, 0.0]
    write_labels(tmp_path / "again.nii.gz", labels.moved(shifted))
    assert measured_noise(case) is None and facts_of(case).noise_sd_mm == Facts.noise_sd_mm
    noise = measure_contour_noise.run(case, {"rest": tmp_path / "again.nii.gz"})
    # Moved by 1 mm along one axis: 1 / sqrt 3 mm rms along the normal of a ball, shared by two drawings.
    assert noise["states"]["rest"]["apart_mm"] == pytest.approx(0.58, abs=0.12)
    assert facts_of(case).noise_sd_mm == noise["sd_mm"] == pytest.approx(0.38, abs=0.1)
    assert facts_of(case).noise_correlation_mm == noise["correlation_mm"]
    case.write_json("noise.json", {"sd_mm": -1.0, "correlation_mm": 5.0})
    with pytest.raises(InputError, match="holds values that cannot be"):
        facts_of(case)
    case.save_facts(replace(case.facts, boundary_noise_sd_mm=0.7))
    assert facts_of(case).noise_sd_mm == 0.7
    with pytest.raises(InputError, match="states boundary_noise_sd_mm; set it to null"):
        measure_contour_noise.run(case, {"rest": tmp_path / "again.nii.gz"})


def test_the_option_names_a_state_and_a_file() -> None:
    assert identify._repeat("deformed=b=2.nii.gz") == ("deformed", Path("b=2.nii.gz"))
    with pytest.raises(argparse.ArgumentTypeError, match="is not like rest=second_drawing"):
        identify._repeat("second.nii.gz")
