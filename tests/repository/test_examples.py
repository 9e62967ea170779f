"""The example gallery: every script and the notebook run on a small case; what takes minutes is left out."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType

import matplotlib as mpl
import numpy as np
import pytest
from dicom_cases import pair
from made_up_body import body
from phantoms import affine, labels, write_case

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.steps.plan import PlanOptions
from palpate.core.diagnose.effects import library
from palpate.imaging.contours.nifti_labels import read_labels, write_labels
from palpate.imaging.dicom.series import read_series
from palpate.meshing.mesh_options import MeshOptions
from palpate.ui.export import exporter

DOCS = Path(__file__).parents[2] / "docs"
EXAMPLES = DOCS / "examples"


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_has_every_example_and_each_is_short() -> None:
    page = (DOCS / "how_to" / "examples.md").read_text(encoding="utf-8")
    there = [
        path for path in EXAMPLES.rglob("*") if path.suffix in (".py", ".ipynb") and "__pycache__" not in path.parts
    ]
    assert len(there) >= 8
    for path in there:
        assert f"../examples/{path.relative_to(EXAMPLES).as_posix()}" in page, path
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 80 or path.suffix == ".ipynb"


def test_the_notebook_finds_the_ball(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its cells in their order, as Jupyter would; the ten lines write nothing."""
    mpl.use("Agg")
    monkeypatch.chdir(tmp_path)
    cells = json.loads((EXAMPLES / "sphere.ipynb").read_text(encoding="utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    known: dict[str, object] = {}
    for cell in code:
        exec(compile(cell, "sphere.ipynb", "exec"), known)
    assert sum(len([line for line in cell.splitlines() if line]) for cell in code) <= 10
    assert known["found"].G_kpa["region_1"] == pytest.approx(60.0, rel=0.25)  # type: ignore[attr-defined]
    assert not list(tmp_path.iterdir())


def test_the_phantom_is_two_scans(tmp_path: Path) -> None:
    scans = [read_series(path)[0] for path in example("phantom").main(tmp_path, (8.0, 8.0, 10.0))]
    assert scans[0].array.shape == scans[1].array.shape and (scans[0].array != scans[1].array).any()
    assert scans[0].array.max() > 300 and scans[0].array.min() < -500, "bone and air"


def test_contours_of_a_person_go_into_the_case(tmp_path: Path) -> None:
    case = pair(tmp_path / "drawn", affine())
    files = {path.name: path for path in exporter("rtstruct").export(case, tmp_path / "out")}
    drawn = tuple(next(path for name, path in files.items() if state in name) for state in ("rest", "deformed"))
    made = example("real_contours").read(
        case.file("rest_ct"), case.file("deformed_ct"), drawn, tmp_path / "case", align=False
    )
    for state in ("rest", "deformed"):
        (name,) = (path.name for path in made.path.glob(f"{state}_user*"))
        assert {1, 2, 5} <= set(np.unique(read_labels(made.file(name)).array).tolist())


def test_a_further_state_joins_the_case_once(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    further = tmp_path / "third.nii.gz"
    write_labels(further, labels(affine(), push_mm=5.0))
    for _ in range(2):
        made = example("several_states").add(case.path, further, align=False)
    assert [state["labels"] for state in made.read_json("case.json")["states"]] == ["deformed_2.nii.gz"]


def test_the_bench_body_is_understood(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bench = example("bench_body")
    bench.look(bench.write(tmp_path / "block", cells=60))
    told = capsys.readouterr().out
    assert "8 numbers seen" in told and int(told.split()[0]) > 30


def test_the_effect_of_ones_own_is_the_one_of_the_page() -> None:
    page = (DOCS / "effects.md").read_text(encoding="utf-8")
    assert page.split("```python\n")[1].split("```")[0] == (EXAMPLES / "effects" / "scar.py").read_text(
        encoding="utf-8"
    )
    assert library(EXAMPLES / "effects")["scar"].settled_by == "an elastography of the scarred place"


def test_a_plan_is_a_line_for_each_amount(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = CaseFolder.create(tmp_path / "case", CaseFacts("made-up"))
    case.write_labels("rest", body())
    example("plan").main(case.path, PlanOptions("emptying", (2.0,), element="p1p1", mesh=MeshOptions(edge_mm=9.0)))
    assert capsys.readouterr().out.startswith("2.0 mm: {'prostate_left': 'x/ ")


def test_many_patients_become_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "patients.csv").write_text("name,rest,deformed\nA,a,b\n")
    answer = {
        "result": {"parameters": {"prostate_left": {"G_kpa": 31.5, "at_bound": False}}, "misfit": {"rms_mm": 0.4}}
    }
    program = [sys.executable, "-c", f"import json; print(json.dumps({answer!r}))".replace("False", "0")]
    (row,) = example("batch").main(tmp_path / "patients.csv", tmp_path / "out", program)
    assert (row["name"], row["status"], row["prostate_left_kpa"]) == ("A", "done", "31.5")
    assert "A done 31.5" in capsys.readouterr().out
