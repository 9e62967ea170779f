"""What is given and not known is refused, by kind and not by instance: a key at any depth, a key given twice, a column, a cell."""

from __future__ import annotations

import copy
import csv
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fuzz"))
from case_targets import body_json

from palpate.case.case_folder import CaseFolder
from palpate.case.landmarks import read_landmarks
from palpate.case.stated_files import further_states
from palpate.case.steps.diagnose import DiagnoseOptions
from palpate.case.steps.simulate.spec import parse_spec
from palpate.core.errors import InputError
from palpate.core.files.json_types import typed_strictly
from palpate.core.identify.options import IdentifyOptions
from palpate.ui.cli.batch import read_table
from palpate.validate.paper.cohort import cohort_of_table

QUICK = settings(
    max_examples=60, deadline=None, database=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
KEY = st.text(st.characters(categories=("L", "N", "Pd", "Pc")), min_size=1, max_size=12)
WORD = st.text(st.characters(codec="utf-8", categories=("L", "N")), min_size=1, max_size=8)
SCHEMAS = {
    path.name.split(".")[0]: json.loads(path.read_text(encoding="utf-8"))
    for path in (Path(__file__).parents[2] / "docs/schemas").glob("*.json")
}
SCHEMA = SCHEMAS["spec"]
KNOWN = {
    key for one in SCHEMAS.values() for part in (one, *one["$defs"].values()) for key in part.get("properties", {})
}
FREE = ("notes",)  # remarks of a person, which nothing reads


def spec() -> dict[str, Any]:
    """A specification with an object wherever the schema has one."""

    def filled(part: dict[str, Any]) -> Any:
        if "$ref" in part:
            return filled(SCHEMA["$defs"][part["$ref"].rsplit("/", 1)[1]])
        for choice in part.get("anyOf", []):
            if "$ref" in choice:
                return filled(choice)
        inner = {name: filled(one) for name, one in part.get("properties", {}).items()}
        return {name: one for name, one in inner.items() if isinstance(one, dict)} if "properties" in part else None

    made: dict[str, Any] = filled(SCHEMA)
    made["stiffness_kpa"] = {"prostate_left": 30.0, "prostate_right": 60.0}
    made["hidden"]["inclusion"] |= {"half": "prostate_left", "factor": 3.0}
    made["hidden"]["tissue_heterogeneity"] |= {"towards": [1.0, 0.0, 0.0], "factor": 3.0}
    made["hidden"]["interface_sliding"] |= {"softer": 3.0}
    made["hidden"]["capsule"] |= {"factor": 3.0}
    return made


def test_the_specification_holds_an_object_of_every_kind() -> None:
    assert len(list(objects(spec()))) >= 10 and len(KNOWN) > 100


def objects(value: object, path: tuple[object, ...] = ()) -> Iterator[tuple[object, ...]]:
    """Paths of all objects within a JSON value."""
    if isinstance(value, dict):
        yield path
        for key, inner in value.items():
            yield from () if key in FREE else objects(inner, (*path, key))
    elif isinstance(value, list):
        for at, inner in enumerate(value):
            yield from objects(inner, (*path, at))


def case_of_a_body(folder: Path) -> tuple[dict[str, Any], Callable[[dict[str, Any]], object]]:
    file, read, _ = body_json(folder)
    return json.loads(file.read_text()), lambda data: (file.write_text(json.dumps(data)), read())


def case_of_states(folder: Path) -> tuple[dict[str, Any], Callable[[dict[str, Any]], object]]:
    folder.mkdir()
    (folder / "more.nii.gz").write_bytes(b"not read here")

    def read(data: dict[str, Any]) -> object:
        (folder / "case.json").write_text(json.dumps(data))
        return further_states(CaseFolder(folder))

    return {"name": "c", "notes": {"any": 1}, "states": [{"labels": "more.nii.gz", "name": "balloon"}]}, read


READERS = {
    "body": case_of_a_body,
    "states": case_of_states,
    "spec": lambda folder: (spec(), parse_spec),
    "identify": lambda folder: ({"seed": 1}, lambda data: typed_strictly(data, IdentifyOptions, "options")),
    "diagnose": lambda folder: ({"seed": 1}, lambda data: typed_strictly(data, DiagnoseOptions, "options")),
}


@pytest.fixture(scope="module", params=READERS)
def given_json(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    return READERS[request.param](tmp_path_factory.mktemp("json") / "case")  # type: ignore[operator, no-untyped-call]


@QUICK
@given(st.data())
def test_a_key_that_is_not_known_is_refused_at_any_depth(given_json: Any, data: st.DataObject) -> None:
    good, read = given_json
    read(good)
    path = data.draw(st.sampled_from(list(objects(good))))
    changed = copy.deepcopy(good)
    place = changed
    for step in path:
        place = place[step]
    key = data.draw(KEY)
    assume(key not in KNOWN)
    place[key] = data.draw(st.sampled_from([None, 1.0, "text", [], {}]))
    with pytest.raises(InputError) as refused:
        read(changed)
    assert key in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("key", ["supports", "model_gravity", "cells"])
def test_what_only_a_body_has_is_refused_without_one(tmp_path: Path, key: str) -> None:
    (tmp_path / "case.json").write_text(json.dumps({"name": "c", key: []}))
    with pytest.raises(InputError, match=f"{key} is of a body on a bench, whose surface 'body' names; add that, or"):
        CaseFolder(tmp_path)


@QUICK
@given(st.data())
def test_a_key_that_is_given_twice_is_refused(tmp_path: Path, data: st.DataObject) -> None:
    good = {"name": "c", "notes": {"a": 1}, "states": []}
    key = data.draw(st.sampled_from(sorted(good)))
    text = json.dumps(good)
    (tmp_path / "case.json").write_text(f"{text[:-1]}, {json.dumps(key)}: {json.dumps(good[key])}}}")
    with pytest.raises(InputError, match=f"{key} is given twice in one object; keep one of them"):
        CaseFolder(tmp_path)


TABLES: dict[str, tuple[Callable[[Path], object], list[list[str]]]] = {
    "landmarks": (
        read_landmarks,
        [["name", "rest_x", "rest_y", "rest_z", "deformed_x", "deformed_y", "deformed_z"], ["a", *"123456"]],
    ),
    "batch": (read_table, [["name", "rest", "deformed", "rest_labels"], ["p1", "a", "b", "c"], ["p2", "a", "b", "c"]]),
    "cohort": (cohort_of_table, [["stage", "mu_kpa"], ["T1", "12"], ["T2", "30"], ["T3", "41"]]),
}


def write(path: Path, rows: list[list[str]]) -> Path:
    with path.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows(rows)
    return path


@pytest.mark.parametrize("kind", TABLES)
@QUICK
@given(st.data())
def test_a_column_or_a_cell_that_is_not_known_is_refused(kind: str, tmp_path: Path, data: st.DataObject) -> None:
    read, good = TABLES[kind]
    read(write(tmp_path / "table.csv", good))
    rows, word = copy.deepcopy(good), data.draw(WORD)
    if data.draw(st.booleans(), label="a column"):
        assume(word not in rows[0] and word not in ("rest_labels", "deformed_labels", "registration"))
        at = data.draw(st.integers(0, len(rows[0])))
        for k, row in enumerate(rows):
            row.insert(at, word if k == 0 else data.draw(st.sampled_from(["", "1"])))
    else:
        row = data.draw(st.sampled_from(rows[1:]))
        row += ["" for _ in range(data.draw(st.integers(0, 2)))] + [word]
    with pytest.raises(InputError) as refused:
        read(write(tmp_path / "table.csv", rows))
    assert word in str(refused.value) and "\n" not in str(refused.value)
