"""A case with two deformed states: from its label volumes to one stiffness, surer than from either, holding the truth."""

from __future__ import annotations

import argparse
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_case
from block_case import voxels, write_block_case
from diagnoses import diagnosis
from schemas import check_form

from palpate.case.case_folder import CaseFolder
from palpate.case.deformed_states import NewState, add_state
from palpate.case.problem import problem_of, state_problems
from palpate.case.stated_files import further_states
from palpate.case.steps import diagnose, identify
from palpate.core.errors import InputError
from palpate.core.files.json_types import plain
from palpate.core.identify.options import IdentifyOptions
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.case_data import load
from palpate.core.worker.job import Job
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.volume import Volume
from palpate.ui.cli import further_states as options
from palpate.ui.cli.arguments import Parser, UsageError
from palpate.ui.cli.main import main

TRUTH = {"prostate_left": 30.0, "prostate_right": 70.0}
QUICK = IdentifyOptions(method="gauss-newton", starts=1, stiffness_map=False)


@pytest.fixture(scope="module")
def states() -> dict[float, IdentificationProblem]:
    return {depth: synthetic_case.problem((30.0, 70.0), depth=depth, fine=2) for depth in (4.5, 6.0)}


@pytest.fixture(scope="module")
def meshed(states: dict[float, IdentificationProblem], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first state is the smaller push."""
    return write_block_case(tmp_path_factory.mktemp("states") / "case", states[4.5], 4.5).path


@pytest.fixture
def case(meshed: Path, tmp_path: Path) -> CaseFolder:
    return CaseFolder(shutil.copytree(meshed, tmp_path / "case"))


@pytest.fixture(scope="module")
def second(states: dict[float, IdentificationProblem], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("second") / "second.nii.gz"
    write_labels(path, voxels(states[6.0].organ.deformed, 6.0))
    return path


def spread(result: dict[str, Any]) -> np.ndarray:
    return np.array([found["sd_ln_G"] for found in result["parameters"].values()])


def test_a_second_state_makes_the_stiffness_surer_and_is_noticed(case: CaseFolder, second: Path) -> None:
    alone = plain(identify.run(case, QUICK))
    added = add_state(case, NewState(second))
    assert (added.labels, further_states(case)) == ("deformed_2.nii.gz", (added,))
    assert add_state(case, NewState(second)) == added and len(further_states(CaseFolder(case.path))) == 1
    check_form(case.read_json("result.json"), "result")
    both = plain(identify.run(case, QUICK))
    assert (spread(both) < 0.8 * spread(alone)).all()
    for name, found in both["parameters"].items():
        assert found["ci95_kpa"][0] < TRUTH[name] < found["ci95_kpa"][1]
    assert len(both["states"]) == 2 and "deformed_2.nii.gz" in both["inputs_sha256"]


def test_another_law_of_the_organ_is_kept_and_the_diagnosis_takes_it(
    case: CaseFolder, capfd: pytest.CaptureFixture[str]
) -> None:
    asked = ["identify", str(case.path), "--method", "gauss-newton", "--no-map", "--quiet", "--law"]
    assert main([*asked, "none"]) == 3
    assert "law 'none' is unknown; choose one of linear, " in capfd.readouterr().err
    assert main([*asked, "neo-hookean", "--split-mu"]) == 3
    assert "mu1 and mu2 are constants of mooney-rivlin, not of neo-hookean" in capfd.readouterr().err
    assert main([*asked, "neo-hookean"]) == 0
    found = case.read_json("result.json")
    check_form(found, "result")
    assert found["options"]["law"] == "neo-hookean"
    assert "G is the initial shear modulus of the law neo-hookean" in found["identifiability"]["verdict"]
    for name, region in found["parameters"].items():
        assert region["ci95_kpa"][0] < TRUTH[name] < region["ci95_kpa"][1]

    def answer(job: Job, on_message: object) -> dict[str, object]:
        assert load(Path(job.paths["data"])).problem.facts.organ_law == "neo-hookean"
        return diagnosis("none")

    assert diagnose.run(case, do_job=answer).law == "neo-hookean"  # type: ignore[arg-type]
    with pytest.raises(InputError, match="law 'none' is unknown"):
        diagnose.DiagnoseOptions(law="none")


def test_landmarks_come_along_in_the_rest_frame(case: CaseFolder, second: Path, tmp_path: Path) -> None:
    marks = tmp_path / "marks.csv"
    marks.write_text("name,rest_x,rest_y,rest_z,deformed_x,deformed_y,deformed_z\nseed,1,2,3,1,0.5,3\n")
    state = add_state(case, NewState(second, landmarks=marks))
    assert state.landmarks == "landmarks_2.csv"
    first = problem_of(case)
    (problem,) = state_problems(case, first)
    np.testing.assert_allclose(problem.landmarks, [[1, 2, 3, 1, 0.5, 3]])
    assert problem.mesh is first.mesh and problem.organ.rest is first.organ.rest
    # The larger push takes the wall and the organ further along -y.
    for seen, before in ((problem.organ, first.organ), (problem.walls["rectum"], first.walls["rectum"])):
        assert seen.deformed.points[:, 1].mean() < before.deformed.points[:, 1].mean() - 0.2


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"labels": "../other.nii.gz"}, r"labels is .*; it must be the name of a file in the case folder"),
        ({"labels": 3}, "labels is 3; it must be the name of a file in the case folder"),
        ({"labels": "gone.nii.gz"}, "is not there, but case.json names it as a deformed state"),
    ],
)
def test_an_entry_that_names_no_file_of_the_case_is_refused(
    case: CaseFolder, entry: dict[str, Any], message: str
) -> None:
    case.save_facts(replace(case.facts, other={"states": [entry]}))
    with pytest.raises(InputError, match=message):
        further_states(case)


def test_what_cannot_be_a_state_is_refused(case: CaseFolder, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not there; give a label volume"):
        add_state(case, NewState(tmp_path / "none.nii.gz"))
    with pytest.raises(InputError, match="the same labels as the first deformed state; it would count twice"):
        add_state(case, NewState(case.file("deformed.nii.gz")))
    (tmp_path / "ct").mkdir()
    with pytest.raises(InputError, match="labels drawn on a further deformed CT are needed"):
        add_state(case, NewState(tmp_path / "ct"))
    write_labels(tmp_path / "empty.nii.gz", Volume(np.full((4, 4, 4), 3, np.uint8), np.eye(4)))
    with pytest.raises(InputError, match="holds no prostate"):
        add_state(case, NewState(tmp_path / "empty.nii.gz"))


def test_options_that_do_not_belong_together_are_wrong_usage(tmp_path: Path) -> None:
    parser = Parser()
    options.add_arguments(parser)
    (tmp_path / "ct").mkdir()
    given = parser.parse_args(["--more", str(tmp_path / "ct"), "--more-labels", "a.dcm", "--more", "b.nii.gz"])
    given.no_align = False
    assert options.states_of(given) == [NewState(tmp_path / "ct", Path("a.dcm")), NewState(Path("b.nii.gz"))]
    wrong = argparse.Namespace(**{**vars(given), "more_labels": [Path("a"), Path("b")]})
    with pytest.raises(UsageError, match="--more-labels is given 2 times for 1 scans"):
        options.states_of(wrong)
