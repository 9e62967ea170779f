"""Pairs with known truth: the specification, the solved state, and what is written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_body import body
from voxel_shapes import ball, paint

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.steps.simulate.spec import load_spec, parse_spec
from palpate.case.steps.simulate.step import run_simulate
from palpate.core.errors import InputError
from palpate.meshing.partition import make_partition

SPEC: dict[str, Any] = {
    "stiffness_kpa": {"prostate_left": 15, "prostate_right": 45},
    "walls": {
        "contact": "tied",
        "rectum": {"inflate_mm": -3, "push_mm": [1, 3, 0]},
        "bladder": {"push_mm": [0, 0, -2]},
    },
    "mesh": {"edge_mm": 9},
    "output": "labels",
    "seed": 3,
}


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> tuple[CaseFolder, Path, dict[str, Any]]:
    """A small made-up body: meshing the phantom takes half a minute."""
    folder = tmp_path_factory.mktemp("simulate")
    source = CaseFolder.create(folder / "source", CaseFacts("made-up"))
    source.write_labels("rest", body())
    truth = run_simulate({**SPEC, "source": {"case": str(source.path)}}, folder / "pair", folder / "answers")
    return CaseFolder(folder / "pair"), folder / "answers", truth


def test_the_answers_hold_the_truth_and_the_case_does_not(simulated: tuple[CaseFolder, Path, dict[str, Any]]) -> None:
    case, answers, truth = simulated
    told = json.loads((answers / "pair.json").read_text())
    assert told["true_G_kpa"] == {"prostate_left": 15.0, "prostate_right": 45.0} == truth["true_G_kpa"]
    assert told["true_mu1_kpa"]["prostate_right"] + told["true_mu2_kpa"]["prostate_right"] == pytest.approx(45.0 / 2.0)
    for file in case.path.rglob("*.json"):
        assert "true_G" not in file.read_text()
    assert case.facts.other["simulated"] is True


def test_the_organ_keeps_its_volume_and_moves_as_it_is_said_to(
    simulated: tuple[CaseFolder, Path, dict[str, Any]],
) -> None:
    case, answers, truth = simulated
    for sizes in truth["volume_cc"].values():
        assert sizes["deformed"] == pytest.approx(sizes["rest"], rel=0.03)
    surface = np.load(answers / "pair_surface.npz")
    moved = np.linalg.norm(surface["displacement"], axis=1)
    # The answers' file holds 500 nodes at most, the figure is of these.
    assert np.sqrt((moved**2).mean()) == pytest.approx(truth["surface_displacement_rms_mm"], rel=1e-9)
    centre = {}
    for state in ("rest", "deformed"):
        labels = case.labels(state)
        centre[state] = labels.to_lps(np.argwhere(np.isin(labels.array, (1, 2))).astype(float)).mean(axis=0)
    shift = centre["deformed"] - centre["rest"]
    # Drawn after the emptied rectum, towards the patient's back.
    assert shift[1] > 0.5


def test_walls_move_as_the_specification_says(simulated: tuple[CaseFolder, Path, dict[str, Any]]) -> None:
    surface = np.load(simulated[1] / "pair_surface.npz")
    organ = surface["points"].mean(axis=0)
    level = np.abs(surface["wall_rectum"][:, 2] - organ[2]) < 4.0
    # Tied: shrunk by 3 mm all around and pushed by (1, 3, 0); the two halves of the ring cancel in the mean.
    assert surface["wall_rectum_displacement"][level].mean(axis=0) == pytest.approx([1.0, 3.0, 0.0], abs=0.6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"source": "somewhere"}, r'"phantom", \{"case": FOLDER\} or \{"ct": FOLDER, "labels": FILE\}'),
        ({"source": {"ct": "a"}}, r'"phantom", \{"case": FOLDER\} or'),
        ({"stiffness_kpa": {"prostate_left": -1}}, "prostate_left"),
        ({"walls": {}}, "'rectum', 'bladder' or both"),
        ({"mesh": {"element": "p1"}}, "element"),
        ({"colour": 1}, "colour"),
        ({"hidden": {"fog": {}}}, "fog"),
        ({"hidden": {"inclusion": {"half": "prostate_left"}}}, "factor"),
        ({"hidden": {"tissue_heterogeneity": {"towards": [0, 0, 0], "factor": 3}}}, "give a direction"),
    ],
)
def test_a_wrong_specification_is_refused_by_its_key(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_spec({**SPEC, **change})


def test_paths_start_from_the_specification(tmp_path: Path) -> None:
    spec = parse_spec({**SPEC, "source": {"ct": "scan", "labels": "drawn.dcm"}}, tmp_path)
    assert (spec.source.ct, spec.source.labels) == (tmp_path / "scan", tmp_path / "drawn.dcm")  # type: ignore[union-attr]


def test_a_specification_that_is_no_json_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "SPEC.json").write_text("{ not json")
    with pytest.raises(InputError, match=r"SPEC\.json is not valid JSON at line 1"):
        load_spec(tmp_path / "SPEC.json")


def test_answers_inside_the_case_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="never holds its answers"):
        run_simulate(SPEC, tmp_path / "pair", tmp_path / "pair" / "answers")


def test_a_speck_far_from_everything_is_no_organ() -> None:
    """A piece of bone that is too small to count, where no organ is near: once it was called prostate."""
    labels = body()
    labels = paint(labels, lambda points: points[..., 2] + 32.0, 4)  # a plate of bone below
    labels = paint(labels, ball(5.0, (-26.0, -26.0, 10.0)), 4)
    assert make_partition(labels).classify(np.array([[-26.0, -26.0, 10.0]])).tolist() == [0]
