"""What is judged of a comparison, on arrays: predictions of what was left out, gains, placebos, model checks, the verdict."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from linear_case import BOUNDS, LinearCase, N, column, effect, free_field
from organ_case import organ_case

from palpate.core.diagnose.comparison import Comparison, compared
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.placebo import PlaceboSize, placebo_gains
from palpate.core.diagnose.posterior import UNKNOWN
from palpate.core.diagnose.verdict import judge as module
from palpate.core.diagnose.verdict.judge import (
    Diagnosis,
    _moved,
    effect_model,
    judge,
    model_checks,
    plain_model,
    saturated_model,
)
from palpate.core.inference.heldout import Split, gain, predictive_p
from palpate.core.inference.posterior import laplace, prior_precision

RULES = DecisionRules(draws=300, placebos=8)
A, B, D = (column(seed, 0.35) for seed in (1, 2, 4))
FREE = np.hstack([D, 0.5 * column(5), 0.3 * column(6)])
FORCES: Any = SimpleNamespace(free=FREE, response=FREE[:, :2])


@pytest.fixture
def split(monkeypatch: pytest.MonkeyPatch) -> Split:
    """Every datum a row, in ten patches, of which the first five are the organ's."""
    case = LinearCase.of([], np.zeros(N))
    found = Split(np.eye(N), np.repeat(np.arange(10), 6), case.covariance, {"surface": slice(0, 30)})
    monkeypatch.setattr(module, "data_split", lambda fit, rules: found)
    monkeypatch.setattr(module, "_moved", lambda fit: True)
    return found


def judged(hidden: np.ndarray, **change: Any) -> tuple[LinearCase, Comparison, Diagnosis]:
    case = LinearCase.of([effect("a", A), effect("b", B)], hidden)
    case.fit.model.each, case.fit.model.bones, nothing = [], [], SimpleNamespace()  # type: ignore[misc, var-annotated]
    found = compared(case.fit, case.screened, free_field(FREE), RULES)
    fit = replace(case.fit, **change)
    return case, found, judge(fit, found, nothing, FORCES, RULES, 1)  # type: ignore[arg-type]


def test_models_are_linear_around_their_own_optimum_with_their_own_priors(split: Split) -> None:
    case, found, _ = judged(4.0 * A[:, 0])
    J, r = case.fit.linearisation.in_theta, case.fit.linearisation.residual
    plain, free = plain_model(case.fit), saturated_model(case.fit, FORCES)
    np.testing.assert_allclose(plain.precision, prior_precision(BOUNDS))
    np.testing.assert_array_equal(plain.value, np.zeros(2))
    np.testing.assert_array_equal(free.J, np.hstack([J, FREE]))
    np.testing.assert_array_equal(free.r, r)
    np.testing.assert_allclose(free.precision, [*prior_precision(BOUNDS), 1.0, 1.0, 1.0])
    np.testing.assert_array_equal(free.value, np.zeros(5))
    lead = found.lead
    assert lead is not None
    with_effect = effect_model(lead)
    np.testing.assert_allclose(with_effect.J, np.hstack([J, A]))
    np.testing.assert_allclose(with_effect.value, [0.0, 0.0, lead.phi[0]])
    np.testing.assert_allclose(with_effect.precision, [*prior_precision(BOUNDS), 1.0])
    np.testing.assert_allclose(
        with_effect.r, r + J @ (lead.linearisation.theta - case.fit.linearisation.theta) + A @ lead.phi
    )


def test_every_model_foretells_what_was_left_out_and_gains_by_it(split: Split) -> None:
    case, found, diagnosis = judged(4.0 * A[:, 0])
    assert diagnosis.verdict.verdict == "a" and diagnosis.verdict.decided_by == "explained"
    assert diagnosis.split is split
    models = {"": plain_model(case.fit), "ceiling": saturated_model(case.fit, FORCES)}
    models |= {f.hypothesis.effect.id: effect_model(f) for f in found.refits if f.hypothesis.effect is not None}
    for name, model in models.items():
        (alone,) = split.left_out([model])
        np.testing.assert_allclose(diagnosis.left_out[name], alone)
        if name:
            assert diagnosis.gains[name] == gain(split, split.left_out([models[""]])[0], alone)
    assert diagnosis.ceiling == diagnosis.gains["ceiling"]
    assert diagnosis.gains["a"].share > 0.5 > diagnosis.gains["b"].share
    lead = found.lead
    assert lead is not None
    like = PlaceboSize.of(lead.linearisation.residual - case.fit.linearisation.residual, 1, case.fit.weighting)
    of_placebos = placebo_gains(split, models[""], diagnosis.left_out[""], FORCES.response, like, RULES.placebos, 1)
    assert diagnosis.placebo == pytest.approx(np.median([one.share for one in of_placebos]))


@pytest.mark.parametrize(("told", "verdict"), [(True, "none"), (False, "ambiguous")])
def test_without_a_gap_nothing_is_checked_and_what_tells_nothing_is_no_model_without_a_gap(
    told: bool, verdict: str, split: Split
) -> None:
    theta, J = np.log([20.0, 60.0]), np.eye(2) * (30.0 if told else 1e-3)
    _, found, diagnosis = judged(np.zeros(N), posterior=laplace(theta, np.zeros(2), J, BOUNDS))
    assert found.lead is None and diagnosis.placebo == 0.0
    assert (diagnosis.verdict.verdict, diagnosis.verdict.candidates) == (verdict, ())


def test_what_tells_nothing_where_nothing_moved_leaves_nothing_out(
    split: Split, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_moved", lambda fit: False)
    blind = laplace(np.log([20.0, 60.0]), np.zeros(2), 1e-3 * np.eye(2), BOUNDS)
    assert judged(np.zeros(N), posterior=blind)[2].verdict.verdict == "none"


def test_the_checks_are_of_what_was_left_out_of_the_remainder_and_of_the_name(split: Split) -> None:
    case, found, _ = judged(4.0 * A[:, 0])
    lead = found.lead
    assert lead is not None
    checks = {check.name: check for check in model_checks(case.fit, lead, split, FORCES, RULES, 3)}
    assert checks["not_predicted"].p_value == predictive_p(split, effect_model(lead), RULES.draws, 3)
    assert 0.01 < checks["something_left"].p_value <= 1.0
    assert checks["unlike_its_name"].p_value == 1.0
    odd = replace(lead.hypothesis.effect, unlike=lambda phi: f"it pulls by {phi['size_0'] > 0.0}")  # type: ignore[type-var]
    pulls = replace(lead, hypothesis=replace(lead.hypothesis, effect=odd))
    (said,) = (c for c in model_checks(case.fit, pulls, split, FORCES, RULES, 3) if c.name == "unlike_its_name")
    assert (said.p_value, said.sentence) == (0.0, "it pulls by True")


def test_a_remainder_vetoes_a_single_name(split: Split) -> None:
    _, _, diagnosis = judged(12.0 * A[:, 0] + 2.0 * D[:, 0])
    assert diagnosis.verdict.probability["a"] < 1.0
    assert UNKNOWN in diagnosis.verdict.probability
    assert diagnosis.verdict.verdict != "a"


@pytest.mark.parametrize(
    ("mm", "drawn", "moved"), [(0.5, True, True), (0.05, True, False), (2.0, False, True), (0.5, False, False)]
)
def test_the_organ_moved_where_it_would_miss_by_more_than_noise_had_nothing_moved(
    mm: float, drawn: bool, moved: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of contours, mm rms over the surface beside noise of 0.2 mm; of images alone, standard deviations."""
    fit = organ_case(drawn=drawn)
    data = fit.model.data_vectors[0]
    still = np.zeros(data.n)
    still[data.n_modes :] = mm  # landmarks, images, bones: of no account where contours are
    if drawn:
        still[0], still[1:] = mm * np.sqrt(len(data.modes)), 0.0
    monkeypatch.setattr(type(data), "residual", lambda self, scene, u: still)
    monkeypatch.setattr(type(fit), "noise_rms_mm", property(lambda self: [0.2]))
    if not drawn:
        monkeypatch.setattr(type(fit), "noise_rms_mm", property(lambda self: [9.0]))
    assert _moved(fit) == moved
