"""Contours that err by a millimetre tell no stiffness by themselves; what sees the motion lets them speak."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import synthetic_case

from palpate.core.files.json_types import plain
from palpate.core.identify.job import run
from palpate.core.inference.posterior import unknown
from palpate.core.observe.contour_errors import ContourErrors
from palpate.core.residual import contours_alone
from palpate.core.residual.contours_alone import answer, contour_error_mm, misleading_contours
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter


def fit(factor: float, stated: float, marks: int = 0, motion: int = 0, share: float = 0.0) -> Any:
    """What is read of a fit: contours of five points that state an error, found to err `factor` times as much."""
    scene, u = SimpleNamespace(errors=ContourErrors.sharing(np.zeros((5, 3)), np.full((2, 5), stated), share)), None
    return SimpleNamespace(
        sizes=SimpleNamespace(contour=factor),
        model=SimpleNamespace(data_vectors=[SimpleNamespace(n_marks=marks, n_motion=motion)]),
        linearisation=SimpleNamespace(each=[SimpleNamespace(scene=scene, equilibrium=SimpleNamespace(u=u))]),
    )


@pytest.fixture
def as_stated(monkeypatch: pytest.MonkeyPatch) -> None:
    """The errors of a made-up scene are those that it carries."""
    monkeypatch.setattr(contours_alone, "organ_errors", lambda scene, u: scene.errors)


@pytest.mark.usefixtures("as_stated")
def test_the_error_is_the_stated_one_times_what_the_pair_shows() -> None:
    assert contour_error_mm(fit(0.5, 0.8)) == pytest.approx(0.4)
    # What both scans have alike moves no contour against the other.
    assert contour_error_mm(fit(1.0, 1.0, share=0.75)) == pytest.approx(0.5)


@pytest.mark.usefixtures("as_stated")
def test_half_a_millimetre_is_the_limit() -> None:
    assert misleading_contours(fit(0.49, 1.0)) == ""
    assert "one errs by about 0.6 mm" in misleading_contours(fit(0.6, 1.0))
    assert misleading_contours(fit(1.5, 0.4)), "an error that was stated too small"
    assert misleading_contours(fit(0.45, 1.0)) == "", "one that was stated too large"


@pytest.mark.usefixtures("as_stated")
def test_the_answer_is_the_fit_or_what_was_allowed() -> None:
    good, bad = fit(0.4, 1.0), fit(0.6, 1.0)
    good.posterior = bad.posterior = "of the fit"
    bad.bounds = np.log([[5.0, 500.0], [5.0, 500.0]])
    assert answer(good) == "of the fit"
    np.testing.assert_allclose(answer(bad).mean, np.log(50.0))
    assert unknown(answer(bad)).all()


@pytest.mark.usefixtures("as_stated")
@pytest.mark.parametrize("beside", [{"marks": 3}, {"motion": 40}], ids=["landmarks", "images"])
def test_what_sees_the_motion_lets_them_speak(beside: dict[str, int]) -> None:
    assert misleading_contours(fit(1.0, 1.0, **beside)) == ""


def test_an_identification_says_so_and_gives_what_was_allowed(tmp_path: Path) -> None:
    true = synthetic_case.problem(fine=4, coarse=3)
    problem = replace(true, facts=replace(true.facts, noise_sd_mm=2.0))
    np.savez(tmp_path / "problem.npz", **problem.arrays())
    options = {"element": "p1p1", "method": "gauss-newton"}
    job = Job(
        "palpate.core.identify.job:run", str(tmp_path), {"problem": str(tmp_path / "problem.npz")}, options, seed=3
    )
    result = plain(run(job, Reporter(lambda message: None)))
    assert result["identifiability"]["verdict"].startswith("nothing can be identified: contours are all that is seen")
    assert result["notes"][0].startswith("contours are all that is seen")
    low, high = problem.facts.bounds_kpa
    for values in result["parameters"].values():
        assert values["ci95_kpa"][0] < 1.15 * low and values["ci95_kpa"][1] > high / 1.15
    assert result["stiffness_map"] is None
