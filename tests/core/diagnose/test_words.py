"""What is said of a verdict in grey: no gap at the level of the test, yet a cause that is more probable than none. What is said of a
stiffness whose reference is not told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.effects import library
from palpate.core.diagnose.verdict import words
from palpate.core.diagnose.verdict.words import _either_side, _grey, next_measurement, sentence


def said(posterior: dict[str, float]) -> str:
    effects = {"contour_bias": "one contour is too wide", "prestress": "the rest state is loaded"}
    screened = [SimpleNamespace(effect=SimpleNamespace(id=name, words=told)) for name, told in effects.items()]
    diagnosis: Any = SimpleNamespace(
        verdict=SimpleNamespace(posterior=posterior),
        screened=screened,
        test=SimpleNamespace(p_value=0.3),
        rules=DecisionRules(),
    )
    return _grey(diagnosis)


def test_a_cause_more_probable_than_none_is_said() -> None:
    found = said({"none": 0.3, "prestress": 0.6, "contour_bias": 0.04, "unknown": 0.06})
    assert "leaves something out is 0.70, most probably that the rest state is loaded (0.60)" in found
    assert "most probably that the rest state is loaded (0.60)" in said({"none": 0.3, "prestress": 0.6, "unknown": 0.1})


@pytest.mark.parametrize("posterior", [{"none": 0.5, "prestress": 0.5}, {"none": 0.9, "unknown": 0.1}, {}])
def test_else_nothing_is_added(posterior: dict[str, float]) -> None:
    assert said(posterior) == ""


def test_only_tissue_with_two_stiffnesses_leaves_its_reference_open() -> None:
    effects = [SimpleNamespace(effect=effect) for effect in library(None).values()]
    for name in library(None):
        diagnosis: Any = SimpleNamespace(verdict=SimpleNamespace(candidates=(name,)), screened=effects)
        assert ("covers both" in _either_side(diagnosis)) == (name == "tissue_heterogeneity")


@pytest.fixture
def at_bound(monkeypatch: pytest.MonkeyPatch) -> dict[int, str]:
    """Regions whose stiffness ended at a bound; every residual is 0.5 mm."""
    reached: dict[int, str] = {}
    monkeypatch.setattr(words, "residuals", lambda fit: [np.array([0.5, -0.5])])
    monkeypatch.setattr(words, "bounds_reached", lambda fit, theta, rules: reached)
    monkeypatch.setattr(words, "misleading_contours", lambda fit: fit.misleading)
    return reached


def _told(verdict: str, *candidates: str, why: str = "", drawn: bool = True) -> Any:
    effects = [
        ("contour_bias", "one contour is too wide", "a second reader"),
        ("prestress", "it is loaded", "another posture"),
    ]
    screened = [
        SimpleNamespace(effect=SimpleNamespace(id=name, words=said, settled_by=by, parameters=[]))
        for name, said, by in effects
    ]
    fit = SimpleNamespace(organ_drawn=drawn, linearisation=SimpleNamespace(theta=None), misleading="")
    found = SimpleNamespace(verdict=verdict, candidates=candidates, why=why, posterior={"none": 0.9})
    test = SimpleNamespace(detected=verdict != "none", p_value=0.3 if verdict == "none" else 0.01)
    return SimpleNamespace(fit=fit, verdict=found, screened=screened, rules=DecisionRules(), test=test)


def test_no_gap_is_said_with_how_well_the_model_meets_the_organ(at_bound: dict[int, str]) -> None:
    said = sentence(_told("none"))
    assert said.startswith("The model meets the deformed organ to 0.50 mm, as well as the contours allow")
    assert "where the images put it, to 0.50 mm, as well as the images allow" in sentence(_told("none", drawn=False))
    assert next_measurement(_told("none")) is None
    at_bound[0] = "prostate left"
    assert "the stiffness of prostate left ends at the edge of what was allowed" in sentence(_told("none"))
    assert "moves the organ farther" in str(next_measurement(_told("none")))


@pytest.mark.usefixtures("at_bound")
@pytest.mark.parametrize(
    ("verdict", "candidates", "why", "words_of_it", "measurement"),
    [
        ("unknown", (), "", "nothing in the library explains it", "another bladder and rectum filling"),
        (
            "ambiguous",
            (),
            "no cause is told",
            "whether the model leaves anything out: no cause is told.",
            "moves the organ farther",
        ),
        (
            "ambiguous",
            ("contour_bias", "prestress"),
            "",
            "It could be that one contour is too wide or that it is loaded: these scans cannot tell.",
            "a second reader (for contour bias); or another posture (for prestress)",
        ),
        (
            "ambiguous",
            ("prestress",),
            "it would have to pull",
            "It may be that it is loaded, but these scans do not settle it: it would have to pull.",
            "another posture (for prestress)",
        ),
        ("prestress", ("prestress",), "", "because it is loaded; the stiffness with this", None),
    ],
)
def test_every_verdict_has_its_sentence_and_the_next_measurement(
    verdict: str, candidates: tuple[str, ...], why: str, words_of_it: str, measurement: str | None
) -> None:
    told = _told(verdict, *candidates, why=why)
    assert words_of_it in sentence(told)
    found = next_measurement(told)
    assert found is None if measurement is None else measurement in str(found)


@pytest.mark.usefixtures("at_bound")
def test_no_stiffness_is_promised_beside_a_cause_where_contours_mislead() -> None:
    told = _told("prestress", "prestress")
    assert "is given beside the one without" in sentence(told)
    told.fit.misleading = "contours err by more than 0.5 mm"
    assert "given" not in sentence(told) and "because it is loaded; contours that err as much as these" in sentence(
        told
    )


@pytest.mark.usefixtures("at_bound")
@pytest.mark.parametrize(("nothing", "p", "said"), [(0.84, 0.013, True), (0.5, 0.013, True), (0.84, 0.06, False)])
def test_what_noise_seldom_leaves_and_no_cause_explains_better_than_none_is_said(
    nothing: float, p: float, said: bool
) -> None:
    told = _told("none")
    told.verdict.posterior, told.test.p_value = {"none": nothing, "prestress": 1.0 - nothing}, p
    words_of_it = (
        f"(p = 0.013), yet with every cause at its best, that nothing is left out is more probable ({nothing:.2f})."
    )
    assert (words_of_it in sentence(told)) == said
    assert "nothing in these scans says that it leaves anything out" in sentence(told)
