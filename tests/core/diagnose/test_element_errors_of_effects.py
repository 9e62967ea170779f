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


def test_the_correction_at_the_effect_s_optimum_is_what_its_own_mesh_says_and_other_meshes_as_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two states of two rows. The plain model's correction is the mean over meshes, 0.1 off what its own mesh says."""
    rng = np.random.default_rng(3)
    theta, here = np.log([20.0, 60.0]), np.log([25.0, 50.0])
    quick, better, slope = rng.standard_normal(4), rng.standard_normal(4), rng.standard_normal((4, 2))
    of_plain = rng.standard_normal(4)
    before = ElementCorrection(theta, of_plain + 0.1, slope)
    own = ElementCorrection(theta, rng.standard_normal(4), slope)  # what the refit's residual holds already
    states = [SimpleNamespace(rows=slice(0, 2)), SimpleNamespace(rows=slice(2, 4))]
    joint = SimpleNamespace(theta=here, each=states, residual=quick + own.at(here))
    refit: Any = SimpleNamespace(linearisation=joint, correction=own, hypothesis="with the effect")
    fit: Any = SimpleNamespace(model=SimpleNamespace(correction=before))

    def fine(model: Any, hypothesis: Any, at: Any, options: Any) -> Any:
        assert (hypothesis, options) == ("with the effect", own_error._FEW)
        return better[at.rows]

    def again(of: Any, screened: Any, refitted: Any, correction: Any) -> Any:
        assert of is fit and screened is nothing and refitted is refit
        return correction

    monkeypatch.setattr(own_error, "fine_element_residual", fine)
    monkeypatch.setattr(own_error, "refit_corrected", again)
    nothing: Any = None
    found: Any = own_error._with_own_element_error(fit, of_plain, nothing, refit, [nothing, nothing])
    np.testing.assert_allclose(found.at(here), (better - quick) + 0.1)
    np.testing.assert_allclose(found.in_theta(here), slope)
    monkeypatch.setattr(
        own_error,
        "fine_element_residual",
        lambda fine, hypothesis, at, options: better[:2] if at is states[0] else None,
    )
    assert own_error._with_own_element_error(fit, of_plain, nothing, refit, [nothing, nothing]) is None


def test_only_the_leading_effects_are_corrected_and_none_where_the_plain_model_has_no_better_element(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[float] = []

    def again(of: Any, own: Any, effect: Any, refit: Refit, fine: Any) -> None:
        assert of is fit and own is fit.on_own_mesh and effect is screened and fine == []
        asked.append(refit.own_evidence)

    monkeypatch.setattr(own_error, "_with_own_element_error", again)
    screened: Any = SimpleNamespace(effect=SimpleNamespace(id="bone_motion"))
    refits = [_refit(e) for e in (20.0, 20.0 - 0.9 * RULES.hopeless, 19.9 - RULES.hopeless)]
    fit: Any = SimpleNamespace(on_own_mesh=np.zeros(4), model=SimpleNamespace(each=()))
    assert own_error.with_own_element_errors(fit, [screened], refits, RULES) == refits
    assert asked == [20.0, 20.0 - 0.9 * RULES.hopeless]
    asked.clear()
    own_error.with_own_element_errors(fit, [screened], [_refit(20.0)] * 5, RULES)
    assert len(asked) == RULES.at_most
    asked.clear()
    fit.on_own_mesh = None
    assert own_error.with_own_element_errors(fit, [screened], refits, RULES) == refits and not asked
