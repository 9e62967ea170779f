"""The case folder: facts, whole files, kills, steps."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.core.files.atomic import sweep
from palpate.imaging.volume import Volume


@pytest.fixture
def case(tmp_path: Path) -> CaseFolder:
    return CaseFolder.create(tmp_path / "case", CaseFacts("one"))


def test_facts_are_read_with_defaults_and_keys_beyond_them_are_kept(tmp_path: Path) -> None:
    data = {"name": "beam", "body": "body.stl", "states": [{"name": "hanging"}], "gravity_rest": [0, 0, -9.81]}
    (tmp_path / "case.json").write_text(json.dumps(data))
    case = CaseFolder(tmp_path)
    assert case.facts.tissue_shear_modulus_kpa == 20.0 and case.facts.boundary_noise_sd_mm is None
    assert case.facts.gravity_rest == (0.0, 0.0, -9.81) and case.facts.other["body"] == "body.stl"
    case.save_facts(case.facts)
    again = json.loads((tmp_path / "case.json").read_text())
    assert again["states"] == data["states"] and CaseFolder(tmp_path).facts == case.facts


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("name", "", "a name of one line"),
        ("tissue_shear_modulus_kpa", -3, "a number from 0.001 to 1e.06"),
        ("tissue_shear_modulus_kpa", "20", "a number from"),
        ("tissue_poisson_ratio", 0.5, "a number from 0 to 0.4999"),
        ("organ_shear_modulus_bounds_kpa", [500, 5], "two rising numbers"),
        ("boundary_noise_sd_mm", 0, "or null when unknown"),
        ("gravity_rest", [0, 9810, 0], "of length at most 20"),
        ("gravity_deformed", [0, True, 0], "three numbers in m/s"),
        ("outer_surface", "loose", "'fixed' or 'free'"),
    ],
)
def test_wrong_facts_name_property_value_and_range(tmp_path: Path, key: str, value: object, allowed: str) -> None:
    (tmp_path / "case.json").write_text(json.dumps({"name": "x", key: value}))
    with pytest.raises(InputError, match=rf"case.json: {key} is .*; it must be .*{allowed}.*; correct it there"):
        CaseFolder(tmp_path)


def test_what_is_no_case_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is no folder"):
        CaseFolder(tmp_path / "absent")
    with pytest.raises(InputError, match=r"has no case.json; give the path"):
        CaseFolder(tmp_path)
    (tmp_path / "case.json").write_text('{"name": "x",\n oops}')
    with pytest.raises(InputError, match=r"case.json is not valid JSON at line 2"):
        CaseFolder(tmp_path)


def test_a_new_case_spares_other_folders(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(InputError, match="is not empty and no case; choose a new folder"):
        CaseFolder.create(tmp_path, CaseFacts("x"))
    with pytest.raises(InputError, match=r"thesis.txt is a file; choose a new folder"):
        CaseFolder.create(tmp_path / "thesis.txt", CaseFacts("x"))


def test_a_read_only_place_is_refused_even_to_root(tmp_path: Path) -> None:
    place = tmp_path / "place"
    place.mkdir(mode=0o555)
    for path in (place, place / "new", place / "new" / "deeper"):
        with pytest.raises(
            InputError, match=r"cannot be written \(the place is read-only\); choose a writable place with -o"
        ):
            CaseFolder.create(path, CaseFacts("x"))
    assert list(place.iterdir()) == []


def test_a_read_only_case_can_be_read_but_not_written(case: CaseFolder) -> None:
    case.path.chmod(0o555)
    again = CaseFolder(case.path)
    assert again.facts.name == "one"
    with pytest.raises(
        InputError,
        match=r"a.json cannot be written \(Permission denied\); choose another place, or allow writing there",
    ):
        again.write_json("a.json", 1)
    with pytest.raises(InputError, match=r"ct cannot be written"), again.atomic_folder("ct"):
        pass
    case.path.chmod(0o755)
    assert sorted(p.name for p in case.path.iterdir()) == ["case.json"]


def test_a_refused_write_names_the_file_and_leaves_the_old_one(
    case: CaseFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    case.write_json("a.json", 1)

    def refuse(source: Path, target: Path) -> None:
        raise PermissionError(13, "Permission denied", str(target))

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(InputError, match=r"a.json cannot be written \(Permission denied\)"):
        case.write_json("a.json", 2)
    assert case.read_json("a.json") == 1
    assert [p.name for p in case.path.iterdir() if p.name.startswith(".")] == []


def test_files_appear_whole_or_not_at_all(case: CaseFolder) -> None:
    case.write_npz("a.npz", x=np.arange(3))
    with pytest.raises(RuntimeError, match="half way"), case.atomic_path("a.npz") as temporary:
        temporary.write_bytes(b"half")
        raise RuntimeError("half way")
    np.testing.assert_array_equal(case.read_npz("a.npz")["x"], np.arange(3))
    with pytest.raises(ValueError, match="JSON compliant"):
        case.write_json("b.json", {"x": np.nan})
    assert not case.has("b.json")


def test_folders_are_replaced_whole(case: CaseFolder) -> None:
    for content in ("first", "second"):
        with case.atomic_folder("ct") as temporary:
            (temporary / content).write_text(content)
    with pytest.raises(RuntimeError, match="half way"), case.atomic_folder("ct") as temporary:
        (temporary / "third").write_text("third")
        raise RuntimeError("half way")
    assert [p.name for p in case.file("ct").iterdir()] == ["second"]


def test_leftovers_of_killed_runs_are_swept(case: CaseFolder) -> None:
    """A child kills itself in the middle of a file, and in the middle of replacing a folder."""
    script = f"""
import os, signal, sys
from pathlib import Path
from palpate.case.case_folder import CaseFolder
case = CaseFolder({str(case.path)!r})
with case.atomic_folder("ct") as temporary:
    (temporary / "old").write_text("old")
replace = os.replace
def once(source, target):
    replace(source, target)
    if ".kept-" in str(target):
        os.kill(os.getpid(), signal.SIGKILL)
with case.atomic_path("a.json") as temporary:
    temporary.write_text("half")
    os.replace = once
    with case.atomic_folder("ct") as other:
        (other / "new").write_text("new")
"""
    ended = subprocess.run([sys.executable, "-c", script], check=False)
    assert ended.returncode == -signal.SIGKILL
    assert len([p for p in case.path.iterdir() if p.name.startswith(".")]) == 3 and not case.has("ct")
    again = CaseFolder(case.path)
    assert [p.name for p in again.path.iterdir() if p.name.startswith(".")] == [] and not again.has("a.json")
    assert (again.file("ct") / "old").read_text() == "old"


def test_the_files_of_running_processes_are_left(tmp_path: Path) -> None:
    other = tmp_path / f".part-{os.getppid()}-0123abcd-x.json"
    other.write_text("")
    (tmp_path / ".part-of-the-family").write_text("")
    sweep(tmp_path)
    assert other.exists() and (tmp_path / ".part-of-the-family").exists()


def test_a_step_is_done_until_inputs_change_or_outputs_go(case: CaseFolder) -> None:
    case.write_text("in.txt", "a")
    case.write_text("out.txt", "b")
    inputs = case.inputs_sha256(["in.txt", "absent"], {"spacing": 2.0})
    assert not case.step_is_done("mesh", inputs)
    case.mark_done("mesh", inputs, ["out.txt"])
    assert CaseFolder(case.path).step_is_done("mesh", inputs)
    case.write_text("out.txt", "corrected by hand")
    assert case.step_is_done("mesh", inputs)
    assert case.inputs_sha256(["in.txt", "absent"], {"spacing": 3.0}) != inputs
    case.write_text("in.txt", "c")
    assert case.inputs_sha256(["in.txt", "absent"], {"spacing": 2.0}) != inputs
    case.file("out.txt").unlink()
    assert not case.step_is_done("mesh", inputs)


def test_labels_round_trip_and_follow_labels_txt(case: CaseFolder) -> None:
    array = np.zeros((4, 5, 6), dtype=np.uint8)
    array[1, 2, 3], array[3, 4, 0] = 1, 4
    affine = np.diag([-1.0, 1.2, 2.0, 1.0])
    case.write_labels("rest", Volume(array, affine))
    again = case.labels("rest")
    assert np.linalg.det(again.affine[:3, :3]) > 0
    np.testing.assert_allclose(again.to_lps(np.argwhere(again.array == 4)), [[-3.0, 4.8, 0.0]], atol=1e-6)
    text = case.file("labels.txt").read_text()
    case.write_text(
        "labels.txt",
        text.replace('"prostate_left"', '"swap"').replace('"bone"', '"prostate_left"').replace('"swap"', '"bone"'),
    )
    assert case.labels("rest").array.max() == 4 and (case.labels("rest").array == 1).sum() == 1
    np.testing.assert_array_equal(case.labels("rest").array == 1, again.array == 4)
    with pytest.raises(InputError, match="the state 'prone' is unknown"):
        case.labels("prone")


def test_landmarks(case: CaseFolder) -> None:
    assert case.landmarks() is None
    head = "name,rest_x,rest_y,rest_z,deformed_x,deformed_y,deformed_z\n"
    case.write_text("landmarks.csv", head + "seed 1,1,2,3,4,5,6\nb,-1,0,0,0,0,1.5\n")
    points = case.landmarks()
    assert points is not None and points.names == ("seed 1", "b")
    np.testing.assert_array_equal(points.deformed, [[4, 5, 6], [0, 0, 1.5]])
    for text, message in {
        head + "a,1,2,3,4,5,x\n": r"line 2: deformed_z is 'x'; a number in mm",
        head + "a,1,2,3,4,5\n": r"line 2: deformed_z is ''; a number in mm",
        head + "a,1,2,3,4,5,6\na,1,2,3,4,5,6\n": "names the point 'a' more than once",
        head: "holds no point",
        "name,x,y,z\n": "lacks the column rest_x",
        head + ",1,2,3,4,5,6\n": "line 2: the point has no name",
    }.items():
        case.write_text("landmarks.csv", text)
        with pytest.raises(InputError, match=message):
            case.landmarks()


def test_a_blind_case_opens(tmp_path: Path) -> None:
    source = Path(__file__).resolve().parents[2].parent / "shared/data/blind_dev/cases/case_001"
    if not source.is_dir():
        pytest.skip(f"{source} is absent: third-party data, see its README")
    case = CaseFolder(shutil.copytree(source, tmp_path / "case"))
    for state in ("rest", "deformed"):
        assert set(np.unique(case.labels(state).array)) == set(range(7))
    assert len(case.landmarks().names) == 5 and np.array_equal(case.deformed_to_rest(), np.eye(4))
