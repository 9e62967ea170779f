"""Writes docs/schemas/*.json: JSON Schemas of the files that other programs read or write, from the types that the program reads them as.

    .venv/bin/python docs/write_schemas.py

`tests/repository/test_schemas.py` fails when a schema is out of date.
"""

from __future__ import annotations

import inspect
import json
from pathlib import Path
from typing import Any

import msgspec

from palpate.case.case_facts import CaseFacts
from palpate.case.stated_files import BenchBody, FurtherState
from palpate.case.steps.declarations import DIAGNOSE, IDENTIFY, IMPORT, MESH, PLAN
from palpate.case.steps.simulate.spec_file import SpecFile
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.identify.result_record import ReidentificationRecord, ResultRecord

FOLDER = Path(__file__).resolve().parent / "schemas"
DRAFT = "https://json-schema.org/draft/2020-12/schema"
FILES = {
    "result.json": ResultRecord,
    "again.json": ReidentificationRecord,
    "diagnosis.json": DiagnosisRecord,
    "SPEC.json": SpecFile,
}


def schemas() -> dict[str, str]:
    """Text of each schema by its file's name."""
    made = {name: _of(name, kind) for name, kind in FILES.items()}
    made |= {"case.json": _case(), "options.json": _options()}
    return {f"{Path(name).stem.lower()}.schema.json": _text(schema) for name, schema in made.items()}


def _of(title: str, kind: type) -> dict[str, Any]:
    (root,), parts = _components([kind])
    return {"$schema": DRAFT, "title": title, **root, "$defs": parts}


def _case() -> dict[str, Any]:
    """A body on a bench names its surface and its states' points files; other cases may name further label volumes."""
    (facts, body, state), parts = _components([CaseFacts, BenchBody, FurtherState])
    del parts["CaseFacts"]["properties"]["other"]
    drawn = {"if": {"required": ["labels"]}, "then": state}
    return {
        "$schema": DRAFT,
        "title": "case.json",
        **facts,
        "if": {"required": ["body"]},
        "then": body,
        "else": {"properties": {"states": {"type": "array", "items": drawn}}},
        "$defs": parts,
    }


def _options() -> dict[str, Any]:
    """Options of the steps whose options are plain values; the key is the command's name."""
    steps = (IMPORT, MESH, IDENTIFY, DIAGNOSE, PLAN)
    found, parts = _components([step.options_type() for step in steps])
    properties = dict(zip((step.name for step in steps), found, strict=True))
    return {
        "$schema": DRAFT,
        "title": "options of the steps",
        "type": "object",
        "properties": properties,
        "$defs": parts,
    }


def _components(kinds: list[type]) -> tuple[tuple[dict[str, Any], ...], dict[str, Any]]:
    return msgspec.json.schema_components(kinds, schema_hook=_other, ref_template="#/$defs/{name}")


def _other(kind: type) -> dict[str, Any]:
    """What msgspec knows no schema of: a path is a text, an object may be anything."""
    if issubclass(kind, Path):
        return {"type": "string"}
    if kind is object:
        return {"title": "anything"}
    raise NotImplementedError(f"{kind} has no JSON form")


def _text(schema: dict[str, Any]) -> str:
    return json.dumps(_clean(schema), indent=2, ensure_ascii=False) + "\n"


def _clean(value: Any) -> Any:
    """Docstrings without their indentation."""
    if isinstance(value, dict):
        return {
            key: inspect.cleandoc(inner) if key == "description" and isinstance(inner, str) else _clean(inner)
            for key, inner in value.items()
        }
    return [_clean(inner) for inner in value] if isinstance(value, list) else value


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, text in schemas().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
