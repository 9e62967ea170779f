"""The page of the diagnosis's numbers says of every number that decides what it is."""

from __future__ import annotations

import ast
import importlib.util
import json
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import msgspec
import pytest

from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.sourced_number import rows, sourced

TOP = Path(__file__).parents[2]
DOCS = TOP / "docs"
ROOMS = ("core/diagnose", "core/residual", "core/observe", "core/forward")


def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("list_numbers", DOCS / "list_numbers.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_has_every_number_with_its_value() -> None:
    page = script().page()
    for kind, numbers in DiagnosisOptions().tables().items():
        assert f"## {kind.__name__}" in page
        assert all(f"| `{row.name}` |" in page and row.source in page for row in numbers)


def test_every_number_says_its_unit_what_it_is_and_its_source() -> None:
    tables = DiagnosisOptions().tables()
    assert {kind.__name__ for kind in tables} == {"NoiseModelOptions", "WallMotionOptions", "DecisionRules"}
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


def bare_numbers(path: Path) -> list[str]:
    """Numbers of a module that stand in no option type and have no comment above or beside them."""
    lines = path.read_text(encoding="utf-8").splitlines()
    found = [n for n in ast.parse("\n".join(lines)).body if isinstance(n, ast.Assign) and is_number(n.value)]
    said = [n for n in found if lines[n.lineno - 2].startswith("#") or "  # " in lines[n.lineno - 1]]
    return [f"{path.relative_to(TOP)}:{n.lineno}" for n in found if n not in said]


def is_number(node: ast.expr) -> bool:
    if isinstance(node, ast.Tuple):
        return all(is_number(part) for part in node.elts)
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


@pytest.mark.parametrize("room", ROOMS)
def test_a_number_outside_the_option_types_says_what_it_is(room: str) -> None:
    modules = sorted((TOP / room).rglob("*.py"))
    assert len(modules) > 3
    assert [line for path in modules for line in bare_numbers(path)] == []
