"""docs/schemas is what its script writes from the types, and holds what files of the program and its pages have."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import jsonschema
import pytest
from diagnoses import diagnosis
from phantoms import agreement, map_facts, recorded, result
from schemas import CONTRACT, check_form

from palpate.case.case_facts import CaseFacts
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.errors import InputError
from palpate.core.files.json_types import plain, typed
from palpate.core.identify.result_record import ResultRecord

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("write_schemas", DOCS / "write_schemas.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_schemas_are_what_their_script_writes() -> None:
    written = {path.name: path.read_text(encoding="utf-8") for path in (DOCS / "schemas").glob("*.json")}
    assert written == script().schemas(), "run .venv/bin/python docs/write_schemas.py"


def test_every_key_of_the_contract_is_a_declared_one() -> None:
    """And is required where the contract requires it."""
    for name in ("result", "diagnosis"):
        contract = json.loads((CONTRACT / f"{name}.schema.json").read_text(encoding="utf-8"))
        ours = json.loads((DOCS / "schemas" / f"{name}.schema.json").read_text(encoding="utf-8"))
        root = ours["$defs"][ours["$ref"].rpartition("/")[2]]
        assert set(contract["required"]) <= set(root["required"])
        assert set(contract["properties"]) <= set(root["properties"])


def test_pages_and_samples_hold_to_the_schemas() -> None:
    for block in re.findall(r"```json\n(\{.*?)```", (DOCS / "case.md").read_text(encoding="utf-8"), re.DOTALL):
        check_form(json.loads(block), "case")
    check_form(CaseFacts("x", other={"states": [{"labels": "deformed_2.nii.gz"}]}).to_dict(), "case")
    check_form(json.loads((ROOT / "sample_dicom" / "spec.json").read_text(encoding="utf-8")), "spec")


@pytest.mark.parametrize("changes", [{}, {"agreement": agreement(), "stiffness_map": map_facts(), "simulated": True}])
def test_a_result_is_written_as_it_was_read(changes: dict[str, Any]) -> None:
    data = result(**changes)
    check_form(data, "result")
    again = json.loads(json.dumps(plain(recorded(data))))
    check_form(again, "result")
    assert {key: again[key] for key in data if key != "agreement"} == {k: data[k] for k in data if k != "agreement"}


@pytest.mark.parametrize("verdict", ["none", "contour_bias"])
def test_a_diagnosis_is_written_as_it_was_read(verdict: str) -> None:
    data = diagnosis(verdict)
    check_form(data, "diagnosis")
    again = json.loads(json.dumps(plain(typed(data, DiagnosisRecord, "a test"))))
    check_form(again, "diagnosis")
    assert again["gap"] == data["gap"] and again["shrinkage"] == data["shrinkage"]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"G_kpa": -3.0}, r"parameters\.prostate_left\.G_kpa is -3\.0; it must be a number above 0"),
        (
            {"ci95_kpa": [1.0]},
            r"parameters\.prostate_left\.ci95_kpa is \[1\.0\]; it must be 2 numbers, or null when unknown",
        ),
        ({"at_bound": "no"}, r"parameters\.prostate_left\.at_bound is 'no'; it must be true or false"),
    ],
)
def test_a_result_out_of_form_is_refused_by_its_property_and_by_the_schema(change: dict[str, Any], told: str) -> None:
    data = result()
    data["parameters"]["prostate_left"] |= change
    with pytest.raises(InputError, match=rf"^result\.json: {told}"):
        typed(data, ResultRecord, "result.json")
    with pytest.raises(jsonschema.ValidationError, match=r"\S"):
        check_form(data, "result")


def test_a_key_that_is_missing_is_named_where_it_should_be() -> None:
    data = result()
    del data["parameters"]["prostate_right"]["mu1_kpa"]
    with pytest.raises(
        InputError, match=r"^result\.json has no parameters\.prostate_right\.mu1_kpa; it must be a number"
    ):
        typed(data, ResultRecord, "result.json")
    del data["solver"]
    with pytest.raises(InputError, match=r"^result\.json has no (solver|parameters)"):
        typed(data, ResultRecord, "result.json")
