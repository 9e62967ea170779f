"""Identification with the motion that images tell, beside contours that are less well known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_case

from palpate.core.files.json_types import plain
from palpate.core.identify.job import run
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.reidentify import identify_again
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.joint_states import JointLinearisation
from palpate.core.residual.likely_slip import likely_slips
from palpate.core.residual.plain_fit import fit_plain
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter

TRUTH = {"prostate_left": 30.0, "prostate_right": 70.0}
OPTIONS = {"element": "p2p1", "starts": 1, "particles": 12, "iterations": 20, "stiffness_map": False}


@pytest.fixture(scope="module")
def contours() -> IdentificationProblem:
    exact = synthetic_case.problem()
    return replace(exact, facts=replace(exact.facts, noise_sd_mm=0.3))


def _run(problem: IdentificationProblem, folder: Path) -> dict[str, Any]:
    folder.mkdir()
    np.savez(folder / "problem.npz", **problem.arrays())
    job = Job("palpate.core.identify.job:run", str(folder), {"problem": str(folder / "problem.npz")}, OPTIONS, seed=3)
    return plain(run(job, Reporter(lambda message: None)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of the job of `beside`."""
    return tmp_path_factory.mktemp("beside") / "image"


@pytest.fixture(scope="module")
def beside(contours: IdentificationProblem, folder: Path) -> dict[str, Any]:
    """What contours and the motion in the tissue tell together."""
    return _run(replace(contours, matched=synthetic_case.matched()), folder)


def test_motion_in_the_tissue_makes_both_values_surer_and_keeps_them_true(
    contours: IdentificationProblem, beside: dict[str, Any], tmp_path: Path
) -> None:
    alone = _run(contours, tmp_path / "contours")
    for name, true in TRUTH.items():
        wide, narrow = (each["parameters"][name]["sd_ln_G"] for each in (alone, beside))
        assert narrow < 0.6 * wide
        low, high = beside["parameters"][name]["ci95_kpa"]
        assert low < true < high
    assert beside["agreement"]["harmless"]  # the swarm's reduced model carries the points in the tissue too
    assert beside["misfit"]["weighted_from_noise"] > 20 + alone["misfit"]["weighted_from_noise"]


def test_the_motion_is_data_again_where_the_contour_is_drawn_anew(
    contours: IdentificationProblem, beside: dict[str, Any], folder: Path
) -> None:
    problem = replace(contours, matched=synthetic_case.matched())
    again = identify_again(folder, problem, IdentifyOptions(**OPTIONS, seed=3))
    assert again is not None
    for name, theta, sd in zip(beside["parameters"], again.theta, again.posterior.sd, strict=True):
        told = beside["parameters"][name]
        assert theta == pytest.approx(np.log(told["G_kpa"]), abs=0.1 * told["sd_ln_G"])
        assert sd == pytest.approx(told["sd_ln_G"], rel=0.1)


def test_an_organ_that_nobody_drew_in_the_other_scan_is_no_datum(
    contours: IdentificationProblem, beside: dict[str, Any], tmp_path: Path
) -> None:
    """The motion alone tells the stiffness, wherever the surface is said to lie, and tells less than contours beside it."""
    alone = replace(contours, matched=synthetic_case.matched(), organ_drawn=False)
    assert not IdentificationProblem.from_arrays(alone.arrays()).organ_drawn
    surface = alone.organ.deformed
    swollen = replace(surface, points=1.15 * surface.points)
    elsewhere = replace(alone, organ=replace(alone.organ, deformed=swollen))
    found, again = (_run(problem, tmp_path / name) for problem, name in ((alone, "alone"), (elsewhere, "swollen")))
    for name, true in TRUTH.items():
        low, high = found["parameters"][name]["ci95_kpa"]
        assert low < true < high
        assert found["parameters"][name]["sd_ln_G"] > beside["parameters"][name]["sd_ln_G"]
        assert again["parameters"][name]["G_kpa"] == pytest.approx(found["parameters"][name]["G_kpa"], rel=1e-6)
    assert 0 < found["misfit"]["weighted_from_noise"] < beside["misfit"]["weighted_from_noise"]
    assert again["misfit"]["rms_mm"] > 0.5  # said, although it is no datum


def test_images_alone_do_not_slide_the_walls_of_the_state_that_is_shown(contours: IdentificationProblem) -> None:
    """What they say of a slip holds together with what they say of edge, alignment and local error, which no scene shows."""
    fit = fit_plain([(replace(contours, matched=synthetic_case.matched()), None)], how=FitOptions(starts=1))
    at, data = fit.linearisation.each[0], fit.model.data_vectors[0]

    def halves(rows: slice, by: float) -> list[np.ndarray]:
        residual = at.residual.copy()
        residual[rows] += by * np.linspace(-1.0, 1.0, rows.stop - rows.start)
        other = replace(fit, linearisation=JointLinearisation((replace(at, residual=residual),)))
        return [motion.slip.factor for motion in likely_slips(other, 0).values() if motion.slip is not None]

    before = halves(data.motion, 0.0)
    assert before
    np.testing.assert_array_equal(halves(data.motion, 5.0), before)
    assert np.abs(np.subtract(halves(slice(0, data.n_modes), 5.0), before)).max() > 1e-3
