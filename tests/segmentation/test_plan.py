"""Planning a second scan from the first alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from made_up_body import body

from palpate.core.errors import InputError
from palpate.segmentation import plan_step
from palpate.segmentation.case import CaseFolder
from palpate.segmentation.case_facts import CaseFacts
from palpate.segmentation.meshing import MeshOptions
from palpate.segmentation.plan_step import PlanOptions
from palpate.ui.pictures.plan_curve import plan_curve

OPTIONS = PlanOptions("emptying", (0.8, 2.0), element="p1p1", mesh=MeshOptions(edge_mm=12.0))


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    made = CaseFolder.create(tmp_path_factory.mktemp("plan") / "case", CaseFacts("made-up"))
    made.write_labels("rest", body())
    return made


@pytest.fixture(scope="module")
def plan(case: CaseFolder) -> dict[str, Any]:
    return plan_step.run(case, OPTIONS)


def test_more_deformation_tells_more_of_both_halves(case: CaseFolder, plan: dict[str, Any]) -> None:
    assert case.read_json("plan.json") == plan
    small, large = plan["rows"]
    for name in ("prostate_left", "prostate_right"):
        assert large["sd_ln_G"][name] < small["sd_ln_G"][name]
        assert large["signal_mm"][name] > 1.8 * small["signal_mm"][name]
    assert plan["assumed_G_kpa"] == {"prostate_left": 20.0, "prostate_right": 20.0}
    assert plan["verdict"].startswith("emptying: prostate left:")


def test_what_is_given_is_assumed(case: CaseFolder) -> None:
    with pytest.raises(InputError, match="prostate_left and prostate_right; prostate_right does not fit"):
        plan_step.run(case, PlanOptions(stiffness_kpa={"prostate_left": 10.0}, mesh=OPTIONS.mesh))


def test_the_picture_shows_every_amount(plan: dict[str, Any]) -> None:
    axes = plan_curve(plan).axes[0]
    assert [list(line.get_xdata()) for line in axes.lines[:2]] == [[0.8, 2.0]] * 2
    assert "mm" in axes.get_xlabel()


@pytest.mark.parametrize("amounts", [(3.0, 1.0), (0.0, 1.0), (-1.0,)])
def test_amounts_ascend(case: CaseFolder, amounts: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="not positive and ascending"):
        plan_step.run(case, PlanOptions(amounts=amounts))


def test_a_case_without_labels_is_refused_by_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"rest\.nii\.gz is not there"):
        plan_step.run(CaseFolder.create(tmp_path / "case", CaseFacts("empty")))
