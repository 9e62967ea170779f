"""What is said of a verdict in grey: no gap at the level of the test, yet a cause that is more probable than none. What is said of a
stiffness whose reference is not told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from palpate.core.diagnose.effects import library
from palpate.core.diagnose.verdict.words import _either_side, _grey


def said(posterior: dict[str, float]) -> str:
    effects = {"contour_bias": "one contour is too wide", "prestress": "the rest state is loaded"}
    screened = [SimpleNamespace(effect=SimpleNamespace(id=name, words=words)) for name, words in effects.items()]
    diagnosis: Any = SimpleNamespace(verdict=SimpleNamespace(posterior=posterior), screened=screened)
    return _grey(diagnosis)


def test_a_cause_more_probable_than_none_is_said() -> None:
    found = said({"none": 0.3, "prestress": 0.6, "contour_bias": 0.04, "unknown": 0.06})
    assert "leaves something out is 0.70, most probably that the rest state is loaded (0.60)" in found


@pytest.mark.parametrize("posterior", [{"none": 0.5, "prestress": 0.5}, {"none": 0.9, "unknown": 0.1}, {}])
def test_else_nothing_is_added(posterior: dict[str, float]) -> None:
    assert said(posterior) == ""


def test_only_tissue_with_two_stiffnesses_leaves_its_reference_open() -> None:
    effects = [SimpleNamespace(effect=effect) for effect in library(None).values()]
    for name in library(None):
        diagnosis: Any = SimpleNamespace(verdict=SimpleNamespace(candidates=(name,)), screened=effects)
        assert ("covers both" in _either_side(diagnosis)) == (name == "tissue_heterogeneity")
