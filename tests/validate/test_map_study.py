"""The study of the map: what is drawn is mapped as the model says, foci are where they are put, and the table says it."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from palpate.core.errors import InputError
from palpate.core.fem.meshes import box
from palpate.core.identify.map.local_field import LocalField, Regional
from palpate.core.identify.map.patches import Patches
from palpate.core.identify.map.stiffness_map import StiffnessMap
from palpate.ui.cli.arguments import UsageError
from palpate.ui.cli.commands.validate import STUDIES
from palpate.ui.pictures.studies.intervals import study_map
from palpate.validate.stiffness_map.case_map import CaseMap
from palpate.validate.stiffness_map.records import MapStudyOptions
from palpate.validate.stiffness_map.solved import Focus, OtherBody
from palpate.validate.stiffness_map.study import _Cover, _Finds, known_truth, map_study, on_arrays, study_text

PLACES = 12


def case_map() -> CaseMap:
    """Two halves of places in a row, each seen by itself, as a case's own fit would have them."""
    centres = np.column_stack([8.0 * np.arange(2 * PLACES), np.zeros((2 * PLACES, 2))])
    each = np.arange(2 * PLACES)
    patches = Patches(each, each, centres, np.full(2 * PLACES, 512.0), np.repeat([1, 2], PLACES))
    S = 4.0 * np.eye(2 * PLACES)
    J, theta = S @ patches.members, np.log([20.0, 60.0])
    regional = Regional(theta, np.linalg.inv(J.T @ J))
    found = StiffnessMap.of(LocalField(patches, S, regional).posterior(np.zeros(len(S))))
    fit = SimpleNamespace(jacobian=J, posterior=SimpleNamespace(scale=1.0), linearisation=SimpleNamespace(theta=theta))
    problem = SimpleNamespace(region_names={1: "prostate_left", 2: "prostate_right"})
    return CaseMap(SimpleNamespace(path=Path("none")), problem, fit, found)  # type: ignore[arg-type]


def test_maps_of_what_the_model_draws_hold_it_as_often_as_they_say() -> None:
    uniform, varied = _Cover("uniform"), _Cover("varied")
    on_arrays(case_map(), uniform, varied, 150, np.random.default_rng(1))
    for row in (uniform.row, varied.row):
        assert row["pairs"] == 150
        assert 0.6 < row["within_one"] < 0.8 and 0.91 < row["within_two"] < 1.0, row
    assert uniform.row["called"] <= 0.05 < varied.row["called"]


def test_the_halves_are_fitted_anew_to_every_data() -> None:
    """Data of halves stiffer by 0.2 and softer by 0.1, without noise, give just these halves."""
    of = case_map()
    change = np.array([0.2, -0.1])
    made = of.mapped(-of.J @ change)
    np.testing.assert_allclose(made.regional.mean, of.found.regional.mean + change, atol=1e-12)
    np.testing.assert_allclose(made.ln_G, of.found.patches.members @ made.regional.mean, atol=1e-9)


def test_a_focus_fills_its_share_of_every_cell() -> None:
    mesh = box((20.0, 20.0, 20.0), (10, 10, 10))
    focus = Focus((10.0, 10.0, 10.0), 12.0, 8.0)
    of_cells = OtherBody.means(focus, mesh)
    assert of_cells.max() == pytest.approx(np.log(8.0)) and of_cells.min() == 0.0
    assert (of_cells * mesh.volumes).sum() == pytest.approx(np.log(8.0) * np.pi * 12.0**3 / 6.0, rel=0.02)


def test_a_place_counts_as_found_only_where_it_touches_the_focus() -> None:
    of, finds = case_map(), _Finds((12.0, 8.0), _Cover(""))
    data = np.zeros(2 * PLACES)
    data[2] = -4.0 * np.log(8.0)
    made, truth = of.mapped(data), of.found.ln_G
    assert made.called[2] == 1
    finds.add(made, Focus((16.0, 0.0, 0.0), 12.0, 8.0), truth)
    finds.add(made, Focus((160.0, 0.0, 0.0), 12.0, 8.0), truth)
    assert (finds.row["pairs"], finds.row["found"], finds.row["elsewhere"]) == (2, 0.5, 0.5)


def test_the_truth_of_a_pair_of_the_study_of_images_is_found_beside_it(tmp_path: Path) -> None:
    of, answer = case_map(), tmp_path / "answers" / "pair_0001.json"
    case = tmp_path / "cases" / "pair_0001" / "images"
    case.mkdir(parents=True)
    answer.parent.mkdir()
    placed = CaseMap(SimpleNamespace(path=case), of.problem, of.fit, of.found)  # type: ignore[arg-type]
    assert known_truth(placed) is None
    told = {"true_G_kpa": {"prostate_left": 20.0, "prostate_right": 60.0}, "hidden": None}
    answer.write_text(json.dumps(told))
    np.testing.assert_allclose(known_truth(placed), np.log([20.0, 60.0]))
    answer.write_text(json.dumps({**told, "hidden": {"effect": "inclusion"}}))
    assert known_truth(placed) is None


def test_the_table_and_the_picture_say_what_was_found() -> None:
    cover, finds = _Cover("uniform, on arrays"), _Finds((12.0, 8.0), _Cover(""))
    made = case_map().found
    cover.add(made, made.ln_G)
    finds.add(made, Focus((0.0, 0.0, 0.0), 12.0, 8.0), made.ln_G)
    table = {"study": "map", "seed": 1, "cases": ["x"], "cover": [cover.row], "foci": [finds.row]}
    text = study_text(table)  # type: ignore[arg-type]
    assert "uniform, on arrays" in text and "12 mm" in text
    left, right = study_map(table).axes  # type: ignore[arg-type]
    assert left.get_ylabel() == "pairs in which it is told, %" and right.get_ylabel() == "share of the organ, %"


def test_it_asks_for_an_identified_case(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="give --case"):
        STUDIES["map"].run(SimpleNamespace(case=[]), lambda *_: None)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"case\.json|result\.json"):
        map_study(MapStudyOptions((tmp_path,)))
