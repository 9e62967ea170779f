"""docs/diagnosis_numbers.md says of every number that decides what it is, and is what its script writes."""

from __future__ import annotations

import importlib.util
import json
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import msgspec
import pytest

from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.sourced_number import rows, sourced

DOCS = Path(__file__).parents[2] / "docs"


def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("list_numbers", DOCS / "list_numbers.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_what_its_script_writes() -> None:
    written = (DOCS / "diagnosis_numbers.md").read_text(encoding="utf-8")
    assert written == script().page(), "run .venv/bin/python docs/list_numbers.py"


def test_every_number_says_its_unit_what_it_is_and_its_source() -> None:
    tables = DiagnosisOptions().tables()
    assert len(tables) >= 2
    for kind, numbers in tables.items():
        for row in numbers:
            assert row.unit and row.meaning.endswith(".") and row.source.endswith("."), (kind, row.name)


def test_a_number_without_a_source_is_refused() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Bare:
        width: float = 1.0

    with pytest.raises(TypeError, match=r"Bare\.width does not say its unit and source"):
        rows(Bare())


def test_the_schema_has_units_and_sources_from_the_same_declaration() -> None:
    schema = json.dumps(msgspec.json.schema(DiagnosisOptions))
    for numbers in DiagnosisOptions().tables().values():
        assert all(json.dumps(row.source) in schema and json.dumps(row.meaning) in schema for row in numbers)
    assert sourced("mm", "Width.", "Chosen.").extra_json_schema == {"unit": "mm", "source": "Chosen."}
