"""diagnosis.json of a case on arrays: the gap, where it lies, the stiffness with and without, what is flagged, the maps."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from organ_case import BOUNDS, organ_case

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.location import DiscrepancyMaps
from palpate.core.diagnose.verdict import record as module
from palpate.core.diagnose.verdict.record import _flags, _gap, _peak, _plain_stiffness, _stiffness_with, maps, record
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.residual.plain_fit import PlainFit

RULES = DecisionRules()


def maps_of(fit: PlainFit) -> DiscrepancyMaps:
    observation = fit.linearisation.first.scene.observation
    zeros = np.zeros(len(observation.points))
    return DiscrepancyMaps(
        observation.points,
        observation.normals,
        observation.region,
        zeros + 0.5,
        zeros + 2.0,
        np.eye(3),
        2.0 * np.eye(3),
        np.array([1.0, 2.0, 3.0]),
        6.5,
    )


def refit(name: str, fit: PlainFit, where: tuple[float, float, float] | None = None, **phi: float) -> Any:
    parameters = [SimpleNamespace(name=key) for key in phi]
    effect = SimpleNamespace(id=name, parameters=parameters, words=name, settled_by="a look")
    return SimpleNamespace(
        hypothesis=SimpleNamespace(effect=effect, variant=SimpleNamespace(where=where)),
        phi=np.array(list(phi.values())),
        linearisation=fit.linearisation,
        covariance=np.diag([0.04, 0.09]),
        correction=ElementCorrection.none(fit.model.n),
        left_mm=0.0,
    )


def diagnosis(fit: PlainFit, *refits: Any, verdict: str = "none", candidates: tuple[str, ...] = (), **more: Any) -> Any:
    return SimpleNamespace(
        fit=fit,
        rules=RULES,
        test=SimpleNamespace(
            detected=verdict != "none", p_value=0.02, log_factor=3.0, p_smooth=0.04, p_named=0.01
        ),
        screened=[],
        refits=list(refits),
        pairs=[],
        gains={f.hypothesis.effect.id: SimpleNamespace(before_mm=1.0, after_mm=0.4) for f in refits},
        discrepancy=maps_of(fit),
        forces=None,
        verdict=SimpleNamespace(
            verdict=verdict, candidates=candidates, probability={"b": 0.8, "unknown": 0.2}, why="for this reason",
            decided_by="explained", posterior={"none": 0.1, "b": 0.72, "unknown": 0.18},
        ),
        **more,
    )  # fmt: skip


def at(fit: PlainFit, theta: np.ndarray) -> PlainFit:
    """The same fit with another stiffness."""
    moved: Linearisation = replace(fit.linearisation.first, theta=theta)
    return replace(fit, linearisation=replace(fit.linearisation, each=(moved,)))


def test_the_gap_is_the_residual_on_the_organ_beside_its_noise() -> None:
    fit = organ_case()
    data, r = fit.model.data_vectors[0], fit.linearisation.residual
    along = np.abs(data.modes @ r[: data.n_modes])
    found = _gap(diagnosis(fit))
    assert found.rms_mm == pytest.approx(np.sqrt(np.mean(along**2)))
    assert found.p95_mm == pytest.approx(np.quantile(along, 0.95))
    variance = np.diag(fit.weighting.covariance)[: data.n_modes].sum() / len(along)
    assert found.noise_floor_mm == pytest.approx(np.sqrt(variance))
    assert found.contour_noise_sd_mm == pytest.approx(0.8 * fit.sizes.contour)
    assert found.contour_noise_correlation_mm == pytest.approx(np.mean(fit.options.lengths_mm))
    assert (found.p_value, found.statistic, found.p_values) == (0.02, 3.0, {"smooth": 0.04, "named": 0.01})
    assert isinstance(found.states, list) and found.states[0].rms_mm == found.rms_mm


def test_a_stiffness_with_an_effect_is_normal_in_its_logarithm_and_cut_at_the_bounds() -> None:
    fit = organ_case()
    theta, covariance = np.log([30.0, 400.0]), np.array([[0.04, 0.01], [0.01, 0.25]])
    found = _stiffness_with(diagnosis(fit), theta, covariance)
    left, right = found["prostate_left"], found["prostate_right"]
    assert (left.G_kpa, left.sd_ln_G) == pytest.approx((30.0, 0.2))
    assert left.ci95_kpa == pytest.approx((30.0 * np.exp(-0.392), 30.0 * np.exp(0.392)))
    assert left.sd_kpa == pytest.approx(30.0 * np.sinh(0.2))
    assert right.ci95_kpa == pytest.approx((400.0 * np.exp(-0.98), 500.0))
    assert right.sd_kpa == pytest.approx(0.5 * (500.0 - 400.0 * np.exp(-0.5)))
    held = _stiffness_with(diagnosis(fit), np.array([np.log(30.0), BOUNDS[1, 1] - 0.01]), covariance)
    assert held["prostate_right"].sd_kpa == pytest.approx(500.0 - 500.0 * np.exp(-0.51))


def test_the_plain_stiffness_is_the_fit_s_posterior() -> None:
    fit = organ_case()
    found = _plain_stiffness(diagnosis(fit))
    for k, name in enumerate(("prostate_left", "prostate_right")):
        assert found[name].G_kpa == pytest.approx(np.exp(fit.posterior.mean[k]))
        assert found[name].ci95_kpa == pytest.approx(tuple(fit.posterior.interval()[k]))
        assert found[name].sd_ln_G == pytest.approx(fit.posterior.sd[k])


@pytest.mark.parametrize(("end", "said"), [(0, True), (1, True), (None, False)])
def test_a_stiffness_at_a_bound_is_flagged_for_the_fit_and_the_effect(end: int | None, said: bool) -> None:
    fit = organ_case()
    if end is not None:
        fit = at(fit, np.array([BOUNDS[0, end], np.log(60.0)]))
    flags = _flags(diagnosis(fit), refit("a", fit))
    for what in ("without", "with"):
        assert any(f.startswith(f"prostate left: stiffness at its bound {what} the effect") for f in flags) == said
    assert not any("prostate right" in flag for flag in flags)


@pytest.mark.parametrize(("sd", "why"), [(0.2, "absorbing"), (2.0, "next to nothing")])
def test_whether_the_scans_tell_a_stiffness_at_its_bound_is_said(sd: float, why: str) -> None:
    fit = organ_case()
    fit = at(fit, np.array([BOUNDS[0, 0], np.log(60.0)]))
    shown = refit("a", fit)
    shown.covariance = np.diag([sd**2, 0.01])
    assert any("with the effect" in flag and why in flag for flag in _flags(diagnosis(fit), shown))


@pytest.mark.parametrize(("mm", "said"), [(0.30, False), (0.40, True), (0.50, True)])
def test_a_mesh_that_is_too_coarse_is_flagged(mm: float, said: bool) -> None:
    fit = organ_case()
    points, value = len(fit.linearisation.first.scene.observation.points), np.zeros(fit.model.n)
    value[3] = mm * np.sqrt(points)
    value[fit.model.data_vectors[0].n_modes :] = 100.0  # what is no surface does not count
    fit.model.correction = ElementCorrection(np.zeros(0), value, np.zeros((len(value), 0)))
    flags = _flags(diagnosis(fit), None)
    assert any(f"by {mm:.2f} mm: the mesh is too coarse" in flag for flag in flags) == said
    fit.model.each.append(fit.model.each[0])  # the mean over two states of which one is not changed
    fit.model.correction = ElementCorrection(np.zeros(0), 0.8 * np.sqrt(2.0) * value, np.zeros((len(value), 0)))
    flags = _flags(diagnosis(fit), None)
    assert any(f"by {0.8 * mm:.2f} mm: the mesh is too coarse" in flag for flag in flags) == (
        0.8 * mm > RULES.coarse_mm
    )


def test_what_could_not_be_computed_is_flagged() -> None:
    fit = organ_case()
    assert _flags(diagnosis(fit), refit("a", fit)) == []
    shown = refit("a", fit)
    shown.left_mm = 0.5
    assert "by 0.50 mm more" in _flags(diagnosis(fit), shown)[0]
    assert "no better element" in _flags(diagnosis(replace(fit, meshes=0)), None)[0]
    assert _flags(diagnosis(fit, verdict="ambiguous"), None) == ["no effect could be refitted"]
    assert _flags(diagnosis(fit, refit("a", fit), verdict="ambiguous"), None) == []
    quiet = diagnosis(fit, verdict="ambiguous")
    quiet.test.detected = False
    assert _flags(quiet, None) == []


def test_the_place_is_that_of_a_candidate_that_has_one_else_of_the_largest_force() -> None:
    fit = organ_case()
    nowhere, elsewhere = refit("a", fit), refit("c", fit, (9.0, 9.0, 9.0))
    here = refit("b", fit, (4.0, 5.0, 6.0), size=3.0, shift_y=0.5, shift_x=-1.0)
    assert _peak(diagnosis(fit, nowhere, elsewhere, here, candidates=("a", "b"))) == (3.0, 5.5, 6.0)
    assert _peak(diagnosis(fit, elsewhere, candidates=("a",))) == (1.0, 2.0, 3.0)
    without = diagnosis(fit)
    without.discrepancy = replace(without.discrepancy, peak=None)
    assert _peak(without) is None


def test_the_maps_are_those_of_the_plain_model_and_of_every_effect_that_was_refitted() -> None:
    fit = organ_case()
    data, observation = fit.model.data_vectors[0], fit.linearisation.first.scene.observation
    theta, slope = fit.linearisation.theta, np.ones((data.n, 2))
    fit.model.correction = ElementCorrection(theta - 0.1, np.arange(float(data.n)), slope)
    found = maps(diagnosis(fit, refit("a", fit)))
    assert {"predicted/plain", "predicted/a", "correction/a", "offset/a", "points", "nodes"} <= found.keys()
    there = np.arange(float(data.n_modes)) + 2.0 * np.tanh(0.1)
    np.testing.assert_allclose(found["correction/plain"], data.modes @ there)
    assert not found["correction/a"].any()
    # Displacements are counted from the scan: `seen` adds the scene's shift, here nothing that the operator reads.
    np.testing.assert_allclose(found["predicted/a"], observation.points)
    assert found["offset/a"].tolist() == [0.3]
    assert found["residual_mm"][0] == 0.5 and found["standardised"][0] == 2.0
    assert len(found["motion/places"]) == len(observation.motion.rows.places)


@pytest.mark.parametrize(
    ("verdict", "misleading", "told"), [("b", "", True), ("b", "they err", False), ("none", "", False), ("unknown", "", False)]
)  # fmt: skip
def test_a_stiffness_with_an_effect_is_given_where_one_is_named_and_the_contours_allow(
    verdict: str, misleading: str, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = organ_case()
    monkeypatch.setattr(module, "misleading_contours", lambda fit: misleading)
    monkeypatch.setattr(module, "ranking", lambda *a: [])
    monkeypatch.setattr(module, "shrinkage", lambda diagnosis, best: best.hypothesis.effect.id)
    monkeypatch.setattr(module, "sentence", lambda diagnosis: "In words.")
    monkeypatch.setattr(module, "next_measurement", lambda diagnosis: None)
    monkeypatch.setattr(module, "_options", lambda diagnosis: None)
    monkeypatch.setattr(module, "model_average", lambda diagnosis: (np.log([33.0, 66.0]), 0.01 * np.eye(2)))
    found = record(diagnosis(fit, refit("a", fit), refit("b", fit), verdict=verdict, candidates=("b",)), "case 1")
    assert (found.stiffness.with_effect is not None) == told
    if found.stiffness.with_effect is not None:
        assert found.stiffness.with_effect["prostate_left"].G_kpa == pytest.approx(33.0)
    assert found.shrinkage == "b"  # of the most probable one, named or not
    assert found.probability_unknown == 0.2 and found.posterior["none"] == 0.1  # type: ignore[index]
    assert any(flag == f"stiffness: {misleading}" for flag in found.flags) == bool(misleading)
    assert found.where.peak_lps_mm == (1.0, 2.0, 3.0) and found.where.blur_mm == 6.5
    assert (found.decided_by.name, found.decided_by.sentence) == ("explained", "for this reason")  # type: ignore[union-attr]
