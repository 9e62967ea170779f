"""The declarations of the steps: they name what is there, the steps go by them, and the docs' table is made of them."""

from __future__ import annotations

import importlib.util
import inspect
import typing
from pathlib import Path

import pytest
from diagnoses import diagnosis
from phantoms import result

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.diagnosed import stands_otherwise
from palpate.case.steps.declarations import DIAGNOSE, IDENTIFY, IMPORT, MESH, STEPS
from palpate.case.steps.step import Step
from palpate.ui.report.declaration import REPORT

DOCS = Path(__file__).parents[2] / "docs"
ALL = (*STEPS, REPORT)
# Which take their options as a JSON object.
UNTYPED = ("simulate",)


@pytest.fixture
def case(tmp_path: Path) -> CaseFolder:
    made = CaseFolder.create(tmp_path / "case", CaseFacts("made-up"))
    for name in MESH.reads:
        made.write_text(name, name)
    return made


@pytest.mark.parametrize("step", ALL, ids=lambda step: step.name)
def test_a_declaration_names_a_function_and_the_type_of_its_options(step: Step) -> None:
    hints = typing.get_type_hints(step.function())
    wanted = hints["spec" if step.name in UNTYPED else "options"]
    assert step.name in UNTYPED or step.options_type() in typing.get_args(wanted)
    assert step.has_job == ("do_job" in hints)
    assert inspect.isclass(step.options_type()) and step.result and len({s.name for s in ALL}) == len(ALL)


def test_a_step_is_done_until_what_it_reads_or_its_options_change(case: CaseFolder) -> None:
    made_from = MESH.made_from(case, {"tets": 9})
    assert set(made_from.files) == set(MESH.reads)
    assert not MESH.is_done(case, made_from) and MESH.out_of_date(case) is None
    for name in MESH.writes:
        case.write_text(name, "")
    MESH.mark_done(case, made_from)
    assert MESH.is_done(case, MESH.made_from(case, {"tets": 9})) and MESH.out_of_date(case) == ""
    assert not MESH.is_done(case, MESH.made_from(case, {"tets": 8})) and MESH.out_of_date(case) == ""
    case.write_text("labels.txt", "new")
    assert not MESH.is_done(case, MESH.made_from(case, {"tets": 9}))
    assert MESH.out_of_date(case) == "labels.txt has been changed since"
    case.remove("labels.txt")
    assert MESH.out_of_date(case) == "labels.txt has been changed since"


def test_what_only_some_cases_have_is_read_too(case: CaseFolder) -> None:
    assert IDENTIFY.inputs(case) == IDENTIFY.reads == DIAGNOSE.inputs(case)
    case.write_json("noise.json", {})
    assert IDENTIFY.inputs(case) == DIAGNOSE.inputs(case) == (*IDENTIFY.reads, "noise.json")
    states = [{"name": "balloon", "labels": "deformed.nii.gz", "landmarks": "labels.txt"}]
    more = CaseFolder.create(case.path, CaseFacts("made-up", other={"states": states}))
    assert DIAGNOSE.inputs(more) == (*DIAGNOSE.reads, "deformed.nii.gz", "labels.txt", "noise.json")
    body = CaseFolder.create(
        case.path, CaseFacts("beam", other={"body": "b.stl", "states": [{"name": "x", "points": "x.csv"}]})
    )
    assert DIAGNOSE.inputs(body) == ("case.json", "b.stl", "x.csv")


@pytest.mark.parametrize(
    ("stiffness", "gap", "wanted"),
    [
        (True, True, ""),
        (False, False, ""),
        (True, False, "the diagnosis stands on the contours alone, the stiffness on the images too"),
        (False, True, "the stiffness stands on the contours alone, the diagnosis on the images too"),
        (True, None, ""),  # of an earlier version
        (None, True, ""),
    ],
)
def test_a_diagnosis_is_that_of_the_stiffness_beside_it(
    case: CaseFolder, stiffness: bool | None, gap: bool | None, wanted: str
) -> None:
    """`identify` was run anew with other evidence: none of the files that `diagnose` reads tells."""
    case.write_json("result.json", result(**({} if stiffness is None else {"options": {"image": stiffness}})))
    case.write_json("diagnosis.json", diagnosis("none", **({} if gap is None else {"image": gap})))
    DIAGNOSE.mark_done(case, DIAGNOSE.made_from(case, {}), ("diagnosis.json",))
    assert DIAGNOSE.out_of_date(case) == wanted
    case.write_text("mesh.npz", "new")
    assert DIAGNOSE.out_of_date(case) == "mesh.npz has been changed since"


def test_a_diagnosis_of_another_law_is_out_of_date(case: CaseFolder) -> None:
    case.write_json("result.json", result(options={"image": False, "law": "neo-hookean"}))
    case.write_json("diagnosis.json", diagnosis("none", image=False))
    DIAGNOSE.mark_done(case, DIAGNOSE.made_from(case, {}), ("diagnosis.json",))
    assert DIAGNOSE.out_of_date(case) == "the stiffness stands on the law neo-hookean, the diagnosis on mooney-rivlin"
    case.write_json("diagnosis.json", diagnosis("none", image=False, law="neo-hookean"))
    assert stands_otherwise(case) == ""


def test_an_import_reads_nothing_of_the_case_and_is_never_called_out_of_date(case: CaseFolder) -> None:
    IMPORT.mark_done(case, IMPORT.made_from(case, {}), ())
    assert IMPORT.out_of_date(case) is None


def test_the_table_of_the_docs_is_that_of_the_declarations() -> None:
    spec = importlib.util.spec_from_file_location("step_table", DOCS / "step_table.py")
    assert spec is not None and spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    text = (DOCS / "case.md").read_text(encoding="utf-8")
    assert script.page(text) == text, "run `python docs/step_table.py`"
    assert all(f"| `{step.name}` |" in text for step in ALL)
