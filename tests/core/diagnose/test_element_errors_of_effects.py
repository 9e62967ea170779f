"""The better element's error with an effect is taken over, unless the mesh is too coarse for it and the data prefer the quick one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.refit import element_error_of_effects as own_error
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.residual.element_correction import ElementCorrection

POINTS, RULES = 25, DecisionRules()


def _refit(evidence: float, apart_mm: float = 0.0) -> Refit:
    """apart_mm : rms of the correction over the surface's points."""
    correction = replace(ElementCorrection.none(4), value=apart_mm * np.sqrt(POINTS) * np.array([1.0, 0.0, 0.0, 0.0]))
    effect: Any = SimpleNamespace(effect=SimpleNamespace(id="bone_motion"), variant=None)
    nothing: Any = None
    return Refit(effect, nothing, np.zeros((4, 1)), np.eye(2), evidence, evidence, correction, np.zeros(1))


@pytest.mark.parametrize(
    ("apart_mm", "evidence", "taken"),
    [(0.2, 5.0, True), (0.2, 15.0, True), (0.6, 15.0, True), (0.6, 5.0, False)],
)
def test_which_element_stands(apart_mm: float, evidence: float, taken: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    before, after = _refit(10.0), _refit(evidence, apart_mm)
    model = SimpleNamespace(
        each=(),
        correction=ElementCorrection.none(4),
        surface=np.arange(3),
        data_vectors=[SimpleNamespace(modes=np.zeros((POINTS, 3)))],
    )
    fit: Any = SimpleNamespace(on_own_mesh=np.zeros(4), model=model)
    screened: Any = SimpleNamespace(effect=SimpleNamespace(id="bone_motion"))
    monkeypatch.setattr(own_error, "_with_own_element_error", lambda *_: after)
    monkeypatch.setattr(own_error, "corrected", lambda again, refit, effect: again)
    (found,) = own_error.with_own_element_errors(fit, [screened], [before], RULES)
    assert (found is after) == taken
    assert found.left_mm == pytest.approx(0.0 if taken else apart_mm)
    assert found.own_evidence == (evidence if taken else 10.0)
