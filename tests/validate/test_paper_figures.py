"""The paper's figures in short, on coarse meshes. The full ones: `palpate validate sensitivity`, `resolution`, `swarm`, ..."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from palpate.core.errors import InputError
from palpate.ui.cli.commands.validate import STUDIES
from palpate.validate.coverage import CoverageOptions, coverage
from palpate.validate.paper.cohort import CohortOptions, cohort, cohort_of_table
from palpate.validate.paper.resolution import ResolutionOptions, resolution
from palpate.validate.paper.sensitivity import SensitivityOptions, sensitivity, verdict
from palpate.validate.paper.swarm import SwarmStudyOptions, swarm_study
from palpate.validate.paper.tumour_scene import Divisions

SMALL, DATA = Divisions(2, 1, 1), Divisions(4, 1, 1)


def drawn(found: dict[str, Any]) -> int:
    """Panels of a study's picture, after its text was made."""
    study = STUDIES[found["study"]]
    assert study.text(found) and study.picture is not None
    return len(study.picture(found).axes)


def test_a_stiffer_sphere_is_drawn_out_less_and_the_papers_claim_is_answered() -> None:
    found = sensitivity(SensitivityOptions((2, 1, 1), "p1p1", (0.5, 1.0, 2.0)))
    for name, ratios in found["axis_ratio"].items():
        assert ratios[0] > ratios[1] > ratios[2] > 1.0, name
    middle = [found["axis_ratio"][name][1] for name in ("linear", "nonlinear")]
    assert middle[0] == pytest.approx(middle[1], abs=1e-5)  # alike where sphere and surroundings are alike
    assert "the paper" in verdict(found) and drawn(found) == 2


def test_swarm_gauss_newton_and_a_new_surface_find_what_is_there() -> None:
    options = replace(SwarmStudyOptions.quick(), iterations=15, starts=2)
    found = swarm_study(options)
    assert found["largest_ln_G_difference"] < 0.25 * min(found["posterior_sd_ln_G"])
    np.testing.assert_allclose(found["again"]["mu_kpa"], found["again"]["truth_mu_kpa"], rtol=0.3)
    assert found["again"]["cpu_seconds"] < 1.0
    assert drawn(found) == 4


def test_the_element_that_does_not_lock_is_nearer_on_the_same_mesh() -> None:
    found = resolution(ResolutionOptions((SMALL,), DATA, ("p1", "p2p1"), 7))
    locking, ours = (np.mean(row["normal_error_percent"]) for row in found["rows"])
    assert ours < 0.5 * locking
    assert drawn(found) == 2


def test_intervals_hold_the_truth_and_a_blind_one_spans_what_was_allowed() -> None:
    found = coverage(CoverageOptions(30, (0.6, 6.0), ((30.0, 70.0),), SMALL, DATA))
    rows = {row["noise_sd_mm"]: row for row in found["rows"]}
    assert 0.85 <= rows[0.6]["covered"] <= 1.0
    blind = rows[6.0]
    assert blind["called_not_identifiable"] > 10
    assert blind["of_these_spanning_what_was_allowed"] > 0.9 * blind["called_not_identifiable"]
    assert drawn(found) == 2


def test_a_virtual_cohort_goes_with_its_stage() -> None:
    found = cohort(replace(CohortOptions.quick(), patients=4))
    assert [row["stage"] for row in found["rows"]] == [1, 2, 3, 4]
    assert found["statistics"]["clean"]["spearman"] > 0.7
    assert drawn(found) == 3


def test_a_table_of_cases_gives_the_known_statistics(tmp_path: Path) -> None:
    path = tmp_path / "cases.csv"
    path.write_text("case,stage,mu_kpa\na,T1,20\nb,T2,31\nc,2,29\nd,T3,45\n", encoding="utf-8")
    found = cohort_of_table(path)
    x, y = np.array([1.0, 2.0, 2.0, 3.0]), np.array([20.0, 31.0, 29.0, 45.0])
    assert found["statistics"]["table"]["pearson"] == pytest.approx(np.corrcoef(x, y)[0, 1])
    assert found["statistics"]["table"]["spearman"] == pytest.approx(np.corrcoef([1, 2.5, 2.5, 4], [1, 3, 2, 4])[0, 1])
    assert drawn(found) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("stage,G\n1,2\n", "lacks the column mu_kpa"),
        ("stage,mu_kpa\n1,20\n2,x\n", r"line 3: stage '2' and mu_kpa 'x' are not like T2 and 41.5"),
        ("stage,mu_kpa\n1,20\n9,20\n", "line 3: stage 9 or mu_kpa 20 is out of range"),
        ("stage,mu_kpa\n1,20\n2,30\n", "has 2 cases; 3 or more"),
    ],
)
def test_a_wrong_table_is_refused_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "cases.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        cohort_of_table(path)


def test_the_workers_study_is_told_and_drawn() -> None:
    """Measured in tests/benchmarks; here its form."""
    told = {"1": 4.0, "2": 2.1}
    found = {"study": "threads", "particles": 10, "cells": 480, "processors": 2, "seconds": told,
             "speed_up": {"1": 1.0, "2": 1.9}, "efficiency": {"1": 1.0, "2": 0.97}, "paper": "almost linear"}  # fmt: skip
    assert drawn(found) == 2
