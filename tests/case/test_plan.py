"""Planning a second scan from the first alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_body import body

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.problem import facts_of
from palpate.case.steps import plan as plan_step
from palpate.case.steps.plan import PlanOptions
from palpate.case.steps.plan_loads import LOADS
from palpate.core.errors import InputError
from palpate.core.forward.known_loads import Loaded, loaded
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface
from palpate.meshing.label_surfaces import organ_surfaces
from palpate.meshing.mesh_labels import MeshOptions, mesh_labels
from palpate.ui.pictures.plan_curve import plan_curve

OPTIONS = PlanOptions("emptying", (0.8, 2.0), element="p1p1", mesh=MeshOptions(edge_mm=9.0))


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


def loads(case: CaseFolder, name: str, amount: float) -> Loaded:
    """A load on the mesh that `plan` has made."""
    labels = case.labels("rest")
    meshed = mesh_labels(labels, OPTIONS.mesh, case.file("identify") / "plan-meshes")
    organ = organ_surfaces(labels)
    names = {1: "prostate_left", 2: "prostate_right"}
    problem = IdentificationProblem(meshed.mesh, meshed.boundary, {}, SurfacePair(organ, organ), facts_of(case), names)
    return loaded(problem, np.log([20.0, 20.0]), LOADS[name](case, problem, amount), "p1p1")


def enclosed(surface: Surface) -> float:
    return surface.enclosed_volume


def test_pressure_widens_the_rectum_and_pushes_the_prostate_off(case: CaseFolder, plan: dict[str, Any]) -> None:
    found = loads(case, "pressure", 5.0)
    rectum = found.problem.walls["rectum"]
    # Both surfaces are open alike, and their rims do not move.
    assert enclosed(rectum.deformed) > 1.02 * enclosed(rectum.rest) > 0.0
    organ = found.problem.mesh.cells[found.problem.mesh.regions < 3]
    assert found.equilibrium.u[np.unique(organ), 1].mean() < -0.02  # the rectum lies behind


def test_gravity_turned_right_round_moves_nothing_and_turned_over_it_pulls_forward(
    case: CaseFolder, plan: dict[str, Any]
) -> None:
    assert np.abs(loads(case, "posture", 360.0).equilibrium.u).max() < 1e-9
    over = loads(case, "posture", 180.0)
    organ = over.problem.mesh.cells[over.problem.mesh.regions < 3]
    assert over.equilibrium.u[np.unique(organ), 1].mean() < -0.005


def test_a_load_is_planned_like_a_motion(case: CaseFolder, plan: dict[str, Any]) -> None:
    by_pressure = plan_step.run(case, replace(OPTIONS, deformation="pressure", amounts=(2.0, 10.0)))
    small, large = by_pressure["rows"]
    assert by_pressure["unit"] == "kPa" and large["organ_motion_mm"] > 3.0 * small["organ_motion_mm"] > 0.0
    for name in ("prostate_left", "prostate_right"):
        assert large["signal_mm"][name] > 3.0 * small["signal_mm"][name]
    assert "kPa" in plan_curve(by_pressure).axes[0].get_xlabel()


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
