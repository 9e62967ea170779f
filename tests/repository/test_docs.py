"""What docs/ shows of files is what the program reads."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from palpate.case.case_facts import CaseFacts
from palpate.case.stated_files import MarkerState, MovedPatch
from palpate.case.steps.simulate.from_ct import CtSource
from palpate.case.steps.simulate.spec import parse_spec
from palpate.core.errors import InputError
from palpate.core.files import json_types

DOCS = Path(__file__).parents[2] / "docs"


def objects(name: str) -> list[dict[str, Any]]:
    """The JSON objects that a page shows as blocks."""
    blocks = re.findall(r"```json\n(\{.*?)```", (DOCS / name).read_text(encoding="utf-8"), re.DOTALL)
    return [json.loads(block) for block in blocks]


def test_a_case_is_written_as_its_page_shows() -> None:
    case, bench, _ = objects("case.md")
    typed, body = (CaseFacts.from_dict(shown, "docs/case.md") for shown in (case, bench))
    assert typed.boundary_noise_sd_mm == 0.4 and typed.gravity_rest == (0.0, 9.81, 0.0) and not typed.other
    assert {"body", "supports", "states", "density_kg_m3", "model_gravity"} == set(body.other)


def test_a_state_with_a_moved_patch_is_written_as_its_page_shows() -> None:
    *_, shown = objects("case.md")
    state = json_types.typed(shown, MarkerState, "docs/case.md")
    assert state.points_sd_mm == (0.05, None, 0.05)
    assert set(shown["moved"][0]) <= set(MovedPatch.__struct_fields__)
    assert state.moved[0].reaction_n == (None, None, -4.97)


def test_a_case_without_facts_takes_those_of_the_page() -> None:
    shown, *_ = objects("case.md")
    plain = CaseFacts.from_dict({"name": "x"}, "here").to_dict()
    given_only = {"name", "boundary_noise_sd_mm", "gravity_rest", "gravity_deformed"}
    assert {k: v for k, v in plain.items() if k not in given_only} == {
        k: v for k, v in shown.items() if k not in given_only
    }


def test_a_simulation_is_specified_as_its_page_shows() -> None:
    (shown,) = objects("simulate.md")
    spec = parse_spec(shown)
    assert isinstance(spec.source, CtSource) and spec.rectum is not None and spec.rectum.half_length_mm == 60.0


@pytest.mark.parametrize("part", ["", "walls", "walls.rectum", "walls.bladder", "mesh", "scan"])
def test_the_page_names_every_key_of_a_simulation(part: str) -> None:
    spec: dict[str, Any] = {"stiffness_kpa": {"prostate_left": 20}, "walls": {"rectum": {}, "bladder": {}}}
    inner = spec
    for name in filter(None, part.split(".")):
        inner = inner.setdefault(name, {})
    inner["no such key"] = 1
    with pytest.raises(InputError) as refused:
        parse_spec(spec)
    allowed = str(refused.value).split("allowed are ")[1].split(", ")
    page = (DOCS / "simulate.md").read_text(encoding="utf-8")
    for key in allowed:
        assert f"`{key}`" in page or f"`{part}.{key}`" in page or f"`{key}." in page, key
