"""`palpate touch` without a window: a script felt on a small case, its table and picture, and what is refused."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from phantoms import CENTRE, result, write_case
from PIL import Image

from palpate.applications.studies.touch import text
from palpate.applications.touch import case_body
from palpate.applications.touch.touch_study import TouchOptions, halved_ellipsoid, touch_study
from palpate.applications.touch.window.touch_script import parse
from palpate.core.errors import InputError
from palpate.core.mesh import TetMesh
from palpate.imaging.volume import Volume
from palpate.meshing.mesh_labels import MeshedCase, MeshOptions
from palpate.ui.cli import main as cli

X, Y, Z = (float(c) for c in CENTRE)

SCRIPT = f"""
# the patient's left is soft here, the right hard
touch {X + 40} {Y} {Z}
press 2
expect region prostate_left
expect ok true
release
below force_n 0.001
touch {X - 40} {Y} {Z}
press 2
expect region prostate_right
above stiffness_n_per_mm 0.2
slide {X - 30} {Y - 20} {Z}
release
pull 1.5
below force_n -0.05
save felt/curve
"""


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A case of 40 kPa on the left and 120 on the right, whose mesh is there at once."""

    def mesh(labels: Volume, options: MeshOptions, cache: Path) -> MeshedCase:
        body = halved_ellipsoid(4, 2).mesh
        assert options.edge_mm is not None and cache.name == "meshes"
        return MeshedCase(TetMesh(body.points * [0.82, 0.72, 0.75] + CENTRE, body.cells, body.regions), {})

    monkeypatch.setattr(case_body, "mesh_labels", mesh)

    return write_case(tmp_path / "case", result(40.0, 120.0)).path


def test_a_script_feels_both_halves_and_saves_the_curve(
    case: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "script.txt"
    script.write_text(SCRIPT)
    assert cli.main(["touch", str(case), "--headless", "--script", str(script), "--json"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert told["support"] == "bed" and told["G_kpa"] == {"prostate_left": 40.0, "prostate_right": 120.0}
    pressed = [event for event in told["events"] if event["command"] == "press"]
    assert [round(event["indentation_mm"], 6) for event in pressed] == [2.0, 2.0]
    assert pressed[0]["G_ci95_kpa"] == pytest.approx([40.0 / 1.2, 48.0])
    assert 1.8 < pressed[1]["force_n"] / pressed[0]["force_n"] < 3.2  # three times the modulus, the bed in series

    table, picture = (Path(file) for file in told["files"])
    assert (table, picture) == (tmp_path / "felt/curve.csv", tmp_path / "felt/curve.png")
    with table.open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == told["events"][-1]["answers"]
    depth, force = (np.array([float(row[name]) for row in rows]) for name in ("indentation_mm", "force_n"))
    assert (np.sign(force[np.abs(depth) > 0.3]) == np.sign(depth[np.abs(depth) > 0.3])).all()
    assert {row["region"] for row in rows} == {"prostate_left", "prostate_right"}
    image = np.asarray(Image.open(picture).convert("L"))
    assert image.shape[0] > 400 and image.std() > 20


def test_the_organ_is_cut_out_with_a_shell_of_tissue(tmp_path: Path) -> None:
    labels = write_case(tmp_path / "case").labels("rest")
    cut = case_body.organ_in_tissue(labels)
    for label in (1, 2):
        before, after = (v.to_lps(np.argwhere(v.array == label).astype(float)) for v in (labels, cut))
        assert len(before) == len(after) and np.allclose(before.mean(axis=0), after.mean(axis=0))
    assert set(np.unique(cut.array)) == {0, 1, 2, 3} and cut.array.size < labels.array.size


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("press 1\n", "line 1: the probe touches nothing yet; touch a point first"),
        ("touch 0 0 0\npress deep\n", "line 2: `press deep` is not of its form"),
        ("touch 0 0 0\npress nan\n", "line 2: nan mm is no depth"),
        ("touch 0 0 0\nexpect region liver\n", "line 2: region is prostate_"),
        ("radius 900\n", "line 1: a probe's radius of 900 mm is out of range; give 0.5 to 50"),
        ("save curve\n", "line 1: nothing has been pressed or pulled yet"),
        ("poke 1\n", "line 1: no command 'poke'; give one of above"),
    ],
)
def test_a_script_that_cannot_be_done_names_its_line(
    case: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], script: str, words: str
) -> None:
    path = tmp_path / "script.txt"
    path.write_text(script)
    assert cli.main(["touch", str(case), "--headless", "--script", str(path)]) == 3
    error = capfd.readouterr().err.strip().splitlines()[-1]
    assert f"palpate: {path}, {words}" in error


def test_a_case_without_a_stiffness_is_refused_in_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / "script.txt"
    script.write_text("touch 0 0 0\n")
    ask = ["touch", str(tmp_path / "case"), "--headless", "--script", str(script), "--quiet"]
    assert cli.main(ask) == 3
    assert "is no folder; give the path of a case folder" in capfd.readouterr().err
    folder = write_case(tmp_path / "case")
    broken = folder.read_json("result.json")
    broken["parameters"]["prostate_left"]["G_kpa"] = None
    folder.write_json("result.json", broken)
    assert cli.main(ask) == 3
    assert "result.json has no stiffness for" in capfd.readouterr().err
    folder.file("result.json").unlink()
    assert cli.main(ask) == 3
    error = capfd.readouterr().err
    assert "result.json is not there; there is no stiffness to feel before `palpate identify`" in error
    assert len(error.strip().splitlines()) == 1


def test_usage(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert cli.main(["touch", str(tmp_path), "--headless"]) == 2
    assert "--headless needs --script FILE" in capfd.readouterr().err
    assert cli.main(["touch", str(tmp_path), "--radius", "0"]) == 2
    assert "out of range; give 0.5 to 50" in capfd.readouterr().err
    with pytest.raises(InputError, match="line 1: No closing quotation; close the quotation"):
        parse('save "a\n', "s.txt")


def test_the_study_is_told_in_words() -> None:
    found = touch_study(TouchOptions(pokes=3, fine=3, deepest=2.0), halved_ellipsoid(3, 1))
    told = text(found)
    assert told.startswith(f"3 random pokes and pulls, {found['cells']} tetrahedra, probe of 8 mm, to 2 mm")
    assert "answers a second" in told and "Hertz" in told
