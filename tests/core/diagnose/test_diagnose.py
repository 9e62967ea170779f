"""Diagnoses of a small case whose truth is known: nothing left out, and a contour drawn too wide."""

from __future__ import annotations

import json
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from schemas import check_form
from synthetic_case import problem
from triangle_shapes import ball

from palpate.core.diagnose.diagnose import diagnose
from palpate.core.diagnose.effects import Surroundings, library
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.diagnose.posterior import NONE, UNKNOWN, log_prior
from palpate.core.diagnose.refit.variants import capped
from palpate.core.diagnose.verdict.decide import REASONS
from palpate.core.diagnose.verdict.judge import Diagnosis, effect_model, model_checks
from palpate.core.diagnose.verdict.model_average import (
    model_average,
    over_variants,
    plain_stiffness,
)
from palpate.core.diagnose.verdict.record import _stiffness_with, maps, record
from palpate.core.diagnose.verdict.true_error import NoiseOfPoints
from palpate.core.errors import InputError
from palpate.core.files.json_types import plain
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.inference.posterior import prior_precision
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import SurfacePair
from palpate.core.residual import element_error
from palpate.core.residual.case_data import CaseData, arrays, load
from palpate.core.residual.element_error import fine_element_model, fine_element_residual
from palpate.core.residual.fit_options import GOOD
from palpate.core.residual.joint_states import JointLinearisation
from palpate.core.residual.noise_covariance import NoiseParts
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.plain_fit import fit_plain
from palpate.core.surfaces.surface import Surface

KEYS = {"case", "gap", "where", "verdict", "candidates", "ranking", "shrinkage", "stiffness", "next_measurement"}
EFFECTS = {
    k: v
    for k, v in library().items()
    if k in ("contour_bias", "volume_change", "tissue_stiffening", "compressible_organ")
}


@pytest.fixture(scope="module")
def posed():  # type: ignore[no-untyped-def]
    """What the scans would show if the plain model, with the better element and the walls' likeliest motion, were right."""
    found = problem(depth=5.0)
    found = replace(found, facts=replace(found.facts, noise_sd_mm=0.08))
    scene = CompositionScene(SharedGeometry.of(found, GOOD), Composition(found))
    settled = scene.settle(np.log([30.0, 70.0])).equilibrium
    assert settled.converged
    rest = found.organ.rest
    moved = scene.space.interpolation(rest.points, found.regions) @ settled.u
    return replace(found, organ=SurfacePair(rest, replace(rest, points=rest.points + moved)))


def diagnosed(posed, widened_mm: float) -> Diagnosis:  # type: ignore[no-untyped-def]
    seen = posed.organ.deformed
    normals = np.zeros_like(seen.points)
    corners = seen.points[seen.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for k in range(3):
        np.add.at(normals, seen.faces[:, k], cross)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    wide = replace(seen, points=seen.points + widened_mm * normals)
    return diagnose(CaseData(replace(posed, organ=replace(posed.organ, deformed=wide))), EFFECTS)


@pytest.fixture(scope="module")
def none(posed) -> Diagnosis:  # type: ignore[no-untyped-def]
    return diagnosed(posed, 0.0)


@pytest.fixture(scope="module")
def wide(posed) -> Diagnosis:  # type: ignore[no-untyped-def]
    return diagnosed(posed, 0.5)


def test_a_perfect_prediction_has_no_gap(none: Diagnosis) -> None:
    assert none.verdict.verdict == "none"
    assert none.test.p_value > 0.05
    assert none.verdict.candidates == ()
    G = np.exp(none.fit.linearisation.theta)
    np.testing.assert_allclose(G, [30.0, 70.0], rtol=0.3)


def test_no_gap_with_a_stiffness_at_its_bound_is_not_said_to_be_none(none: Diagnosis) -> None:
    """The bound may hide what the model leaves out: the words say so and ask for a scan that tells more."""
    held = none.fit.linearisation.theta.copy()
    held[0] = none.fit.bounds[0, 0]
    at = replace(none.fit.linearisation, each=tuple(replace(one, theta=held) for one in none.fit.linearisation.each))
    written = plain(record(replace(none, fit=replace(none.fit, linearisation=at)), "a case"))
    assert written["verdict"] == "none"
    assert "But the stiffness of prostate left ends at the edge of what was allowed" in written["in_words"]
    assert written["next_measurement"].startswith("a deformed scan in which")
    clear = plain(record(none, "a case"))
    assert "edge" not in clear["in_words"]
    assert clear["next_measurement"] is None


def test_a_scan_against_itself_has_no_gap(posed) -> None:  # type: ignore[no-untyped-def]
    """Nothing moves, so nothing tells the stiffness either: its standard deviation is that of not knowing."""
    rectum = posed.walls["rectum"].rest
    still = replace(
        posed,
        walls={"rectum": SurfacePair(rectum, rectum)},
        organ=SurfacePair(posed.organ.rest, posed.organ.rest),
    )
    found = diagnose(CaseData(still), EFFECTS)
    assert found.verdict.verdict == "none"
    written = plain(record(found, "still"))
    assert written["gap"]["rms_mm"] < 0.05
    assert min(s["sd_ln_G"] for s in written["stiffness"]["without_effect"].values()) > 1.0
    assert not any("absorbing" in flag for flag in written["flags"])


def test_a_better_element_without_an_equilibrium_is_allowed_for_and_said(
    posed, none: Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(element_error, "fine_solution", lambda *_: None)
    found = diagnosed(posed, 0.0)
    assert found.fit.meshes == 0
    assert not found.fit.model.correction.value.any()
    assert any("no better element" in flag for flag in plain(record(found, "hard"))["flags"])
    k = found.fit.model.first.data.n_modes
    assert np.trace(found.fit.weighting.covariance[:k, :k]) > np.trace(none.fit.weighting.covariance[:k, :k])


def test_a_pair_of_scans_moved_rigidly_has_no_gap_and_the_same_stiffness(posed, none: Diagnosis) -> None:  # type: ignore[no-untyped-def]
    """The patient lies elsewhere and turned, in both scans alike."""
    a, b = np.deg2rad([25.0, -10.0])
    R = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    R = R @ np.array([[1.0, 0.0, 0.0], [0.0, np.cos(b), -np.sin(b)], [0.0, np.sin(b), np.cos(b)]])

    def turned(surface: Surface) -> Surface:
        return replace(surface, points=surface.points @ R.T + [30.0, -12.0, 7.0])

    pairs = {name: SurfacePair(turned(p.rest), turned(p.deformed)) for name, p in posed.walls.items()}
    mesh = replace(posed.mesh, points=posed.mesh.points @ R.T + [30.0, -12.0, 7.0])
    organ = SurfacePair(turned(posed.organ.rest), turned(posed.organ.deformed))
    found = diagnose(CaseData(replace(posed, mesh=mesh, walls=pairs, organ=organ)), EFFECTS)
    assert found.verdict.verdict == "none"
    np.testing.assert_allclose(found.fit.linearisation.theta, none.fit.linearisation.theta, atol=0.15)


def test_a_deformed_scan_that_is_not_aligned_on_bone_is_said_to_be_so(posed) -> None:  # type: ignore[no-untyped-def]
    """All of the second scan lies elsewhere, bones too: what was seen of them says so, and no contour or law is blamed."""
    shift = np.array([1.0, -1.5, 0.8])

    def moved(surface: Surface) -> Surface:
        return replace(surface, points=surface.points + shift)

    bone = ball(24.0, (0.0, -40.0, 0.0))
    effects = {k: v for k, v in library().items() if k in ("bone_motion", "contour_bias", "volume_change")}
    walls = {name: SurfacePair(p.rest, moved(p.deformed)) for name, p in posed.walls.items()}
    organ = SurfacePair(posed.organ.rest, moved(posed.organ.deformed))
    apart = replace(posed, walls=walls, organ=organ)
    found = diagnose(CaseData(apart, SurfacePair(bone, moved(bone))), effects)
    assert found.verdict.verdict == "bone_motion"
    best = found.refits[0]
    # Across the planes of walls that were drawn, little but the prior holds a shift: it lies within its own error.
    np.testing.assert_allclose(best.phi[:3], shift, atol=0.35)
    assert (np.abs(best.phi[:3] - shift) < 2.0 * best.sd_phi[:3]).all()
    assert diagnose(CaseData(posed, SurfacePair(bone, bone)), effects).verdict.verdict == "none"


def test_a_contour_drawn_too_wide_is_found_with_its_width(wide: Diagnosis) -> None:
    assert wide.test.detected
    assert "contour_bias" in wide.verdict.candidates
    assert len(wide.verdict.candidates) <= 3
    best = next(r for r in wide.refits if r.hypothesis.effect is not None and r.hypothesis.effect.id == "contour_bias")
    assert best.phi[0] == pytest.approx(0.5, abs=0.1)
    # A flat wall says nothing of its motion along itself, so patches of this case are predicted badly by any model.
    assert wide.gains["contour_bias"].after_mm < 0.8 * wide.gains["contour_bias"].before_mm


@pytest.mark.parametrize("which", ["none", "wide"])
def test_the_record_has_the_form_of_diagnosis_json(which: str, request: pytest.FixtureRequest) -> None:
    found: Diagnosis = request.getfixturevalue(which)
    written = plain(record(found, "a case"))
    assert set(written) >= KEYS
    check_form(written, "diagnosis")
    assert written["decided_by"]["name"] in {*REASONS, "not_predicted", "something_left"}
    assert sum(written["posterior"].values()) == pytest.approx(1.0)
    assert set(written["posterior"]) >= {NONE, UNKNOWN, *EFFECTS}
    assert written["decided_by"]["sentence"] == written["why"]
    assert (written["shrinkage"] is None) == (which == "none")
    assert (written["stiffness"]["with_effect"] is None) == (which == "none")
    assert set(written["stiffness"]["without_effect"]) == {"prostate_left", "prostate_right"}
    assert len(written["ranking"]) == len(EFFECTS)
    for row in written["ranking"]:
        assert 0.0 <= row["probability"] <= 1.0
        assert all({"value", "sd", "unit"} <= set(p) for p in row["parameters"].values())
    drawn = maps(found)
    assert len(drawn["points"]) == len(drawn["standardised"]) == len(drawn["normals"])
    assert np.isfinite(drawn["force_kpa_per_mm"]).all()


def test_a_stiffness_at_its_bound_with_an_effect_says_how_far_it_may_lie_inside(wide: Diagnosis) -> None:
    """Softest allowed on the left, in the middle on the right; standard deviations of 0.5 in ln G."""
    (low, _), (least, most) = wide.fit.bounds
    middle = 0.5 * (least + most)
    left, right = _stiffness_with(wide, np.array([low, middle]), 0.25 * np.eye(2)).values()
    assert left.ci95_kpa == (pytest.approx(np.exp(low)), pytest.approx(np.exp(low + 1.96 * 0.5)))
    assert left.sd_kpa == pytest.approx(np.exp(low) * np.expm1(0.5))
    assert right.sd_kpa == pytest.approx(np.exp(middle) * np.sinh(0.5))
    assert right.ci95_kpa == (pytest.approx(np.exp(middle - 0.98)), pytest.approx(np.exp(middle + 0.98)))


def test_a_small_offset_of_the_whole_contour_is_noise(none: Diagnosis) -> None:
    fit = none.fit
    parts = NoiseParts.of(fit.linearisation.each, fit.model.data_vectors, fit.options)
    left = np.zeros((fit.model.first.data.n, 1))
    with_it, without = (parts.covariance(replace(fit.sizes, offset=size), left) for size in (0.1, 0.0))
    k = fit.model.first.data.n_modes
    seen = (
        fit.model.first.data.modes @ (with_it - without)[:k, :k] @ fit.model.first.data.modes.T
    )  # what the modes show of 0.01 mm2
    wide = fit.model.first.data.modes @ fit.model.first.data.modes.sum(axis=0)
    np.testing.assert_allclose(seen, 0.01 * np.outer(wide, wide), atol=1e-9)
    assert wide.mean() > 0.8


def test_the_stiffness_with_an_effect_is_over_all_that_may_be_it(wide: Diagnosis) -> None:
    mean, covariance = model_average(wide)
    each = np.stack([f.linearisation.theta for f in wide.refits])
    assert (mean > each.min(axis=0) - 1.0).all() and (mean < each.max(axis=0) + 1.0).all()
    written = plain(record(wide, "a case"))["stiffness"]["with_effect"]
    assert written["prostate_left"]["sd_ln_G"] == pytest.approx(float(np.sqrt(covariance[0, 0])))
    assert written["prostate_right"]["G_kpa"] == pytest.approx(float(np.exp(mean[1])))


def test_the_stiffness_without_an_effect_is_the_fits_own(none: Diagnosis) -> None:
    """Nothing is taken off or widened: the numbers are those that `identify` reports."""
    theta, covariance = plain_stiffness(none.fit)
    np.testing.assert_array_equal(theta, none.fit.linearisation.theta)
    np.testing.assert_array_equal(covariance, none.fit.posterior.covariance)
    written = plain(record(none, "a case"))["stiffness"]["without_effect"]
    assert [s["G_kpa"] for s in written.values()] == np.exp(theta).tolist()


def test_contours_that_mislead_tell_a_diagnosis_no_stiffness_either(none: Diagnosis, wide: Diagnosis) -> None:
    rough = replace(none.fit, sizes=replace(none.fit.sizes, contour=20.0))  # times the 0.08 mm that the case states
    written = plain(record(replace(none, fit=rough), "a case"))
    assert written["flags"][0].startswith("stiffness: contours are all that is seen, and one errs by about 1.6 mm")
    low, high = none.fit.model.first.plain.problem.facts.bounds_kpa
    for values in written["stiffness"]["without_effect"].values():
        assert values["ci95_kpa"][0] < 1.15 * low and values["ci95_kpa"][1] > high / 1.15
    assert not any("contours are all" in flag for flag in plain(record(none, "a case"))["flags"])
    rough = replace(wide.fit, sizes=replace(wide.fit.sizes, contour=20.0))
    named = [plain(record(one, "a case")) for one in (wide, replace(wide, fit=rough))]
    assert [one["stiffness"]["with_effect"] is None for one in named] == [False, True]


def test_the_stiffness_with_a_sure_effect_is_over_its_variants(wide: Diagnosis) -> None:
    best = next(f for f in wide.refits if f.hypothesis.effect.id == "contour_bias")
    sure = replace(wide.verdict, probability={"contour_bias": 1.0})
    for told, alone in zip(model_average(replace(wide, verdict=sure)), over_variants(best), strict=True):
        np.testing.assert_allclose(told, alone)
    # The prior is as wide as what was allowed: what the data tell of a stiffness is at least as narrow.
    assert (np.diag(best.covariance)[:2] < 1.0 / prior_precision(wide.fit.bounds)).all()


def test_a_single_name_that_is_not_settled_comes_with_the_reason(wide: Diagnosis) -> None:
    """A clinician who reads "pushes" must read there too that it would have to pull."""
    doubtful = replace(wide.verdict, verdict="ambiguous", candidates=("contour_bias",), why="it would have to pull")
    said = plain(record(replace(wide, verdict=doubtful), "a case"))["in_words"]
    assert said.endswith("these scans do not settle it: it would have to pull.")


def test_a_gap_that_no_effect_comes_near_is_still_written_down(wide: Diagnosis) -> None:
    """Where a free field is likelier by more than a double can hold, every effect's probability is 0."""
    lost = dict.fromkeys(wide.verdict.probability, 0.0) | {"unknown": 1.0}
    found = replace(wide, verdict=replace(wide.verdict, verdict="unknown", candidates=(), probability=lost))
    written = plain(record(found, "a case"))
    assert np.isfinite(written["shrinkage"]["ci95"]).all()
    assert written["stiffness"]["with_effect"] is None


def test_the_floor_of_the_shrinkage_is_the_contours_of_the_organ_alone(wide: Diagnosis) -> None:
    """Two contours of 0.08 mm; walls and the model's own error, which no better contour would take away, are not in it."""
    noise = NoiseOfPoints.of(wide.fit, wide.split, wide.forces.free)
    points = wide.split.organ.stop
    floors = np.array([np.trace(noise.drawing(size)) / points for size in range(len(noise.noise.sizes))])
    stated = noise.noise.sizes[0]
    once, twice = (
        np.trace(noise.reader @ noise.of_organ(replace(stated, contour=c)) @ noise.reader.T) / points
        for c in (1.0, 2.0)
    )
    assert twice - once == pytest.approx(3.0 * 2.0 * 0.08**2, rel=0.1)
    best, m = wide.refits[0], points
    assert best.hypothesis.effect is not None
    error = noise.error_of(effect_model(best), wide.left_out[best.hypothesis.effect.id][:m], wide.fit.options.gap_sizes)
    assert floors.min() < error.floor_mm2 < np.trace(wide.split.covariance[:m, :m]) / m


def test_drawing_and_model_share_the_covariance(wide: Diagnosis) -> None:
    """What is no drawing is a covariance by itself: nothing is taken off twice."""
    noise = NoiseOfPoints.of(wide.fit, wide.split, wide.forces.free)
    assert len(noise.noise.sizes) == 2 * wide.fit.options.points
    for sizes, whole in zip(noise.noise.sizes, noise.noise.covariances, strict=True):
        rest = whole - noise.of_organ(sizes)
        assert np.linalg.eigvalsh(rest).min() > -1e-9
        assert np.linalg.eigvalsh(noise.of_organ(sizes)).min() > -1e-9


def test_a_stress_free_mesh_is_weighed_by_no_more_than_its_first_look(wide: Diagnosis) -> None:
    """Another mesh has another error of the quick element, which would pass for evidence."""
    best = wide.refits[0]
    screened = next(s for s in wide.screened if s.effect is best.hypothesis.effect)
    poor = replace(screened, log_evidence=best.log_evidence - 50.0)
    shift = np.zeros_like(best.linearisation.first.scene.space.mesh.points)
    moved = copy(best.linearisation.first.scene)
    moved.composition = moved.composition.with_geometry(shift)
    elsewhere = replace(best, linearisation=JointLinearisation((replace(best.linearisation.first, scene=moved),)))
    assert capped(best, poor).log_evidence == best.log_evidence
    assert capped(elsewhere, poor).log_evidence == poor.log_evidence


def test_leading_effects_have_the_quick_element_s_error_of_their_own(posed) -> None:  # type: ignore[no-untyped-def]
    """An organ that gives up much volume is another body: what the better element says of it there, not of the plain model."""
    scene = CompositionScene(
        SharedGeometry.of(posed, GOOD),
        EFFECTS["compressible_organ"].variants(Surroundings(posed))[0].applied(Composition(posed), np.array([3.0])),
    )
    settled = scene.settle(np.log([30.0, 70.0])).equilibrium
    assert settled.converged
    rest = posed.organ.rest
    moved = rest.points + scene.space.interpolation(rest.points, posed.regions) @ settled.u
    found = diagnose(CaseData(replace(posed, organ=SurfacePair(rest, replace(rest, points=moved)))), EFFECTS)
    fitted = next(
        f for f in found.refits if f.hypothesis.effect is not None and f.hypothesis.effect.id == "compressible_organ"
    )
    at = fitted.linearisation.first
    better_one = fine_element_residual(fine_element_model(found.fit.model.first), fitted.hypothesis, at)
    assert better_one is not None
    off = [
        np.linalg.norm(at.residual - fitted.correction.at(at.theta) + c.at(at.theta) - better_one)
        for c in (fitted.correction, found.fit.model.correction)
    ]
    assert off[0] < 0.2 * off[1]
    written = maps(found)
    assert np.abs(written["correction/compressible_organ"] - written["correction/plain"]).max() > 0.0


def test_a_mesh_too_coarse_for_the_deformation_is_flagged(none: Diagnosis) -> None:
    assert not any("too coarse" in flag for flag in plain(record(none, "a case"))["flags"])
    much = np.zeros(none.fit.model.first.data.n)
    much[0] = 0.5 * np.sqrt(len(none.discrepancy.points))
    correction = none.fit.model.correction.with_value(much, none.fit.linearisation.theta)
    coarse = replace(none, fit=replace(none.fit, model=none.fit.model.corrected(correction)))
    assert any("by 0.50 mm" in flag and "too coarse" in flag for flag in plain(record(coarse, "a case"))["flags"])


def test_case_data_survive_their_file(posed, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    bones = SurfacePair(*(Surface(np.eye(3) + k, np.array([[0, 1, 2]]), np.array([4])) for k in (0.0, 1.5)))
    np.savez(tmp_path / "data.npz", **arrays(CaseData(posed, bones, ((0.0, 9.81, 0.0), None))))
    back = load(tmp_path / "data.npz")
    assert back.gravity == ((0.0, 9.81, 0.0), None)
    assert back.bones is not None
    np.testing.assert_array_equal(back.bones.deformed.points, bones.deformed.points)
    np.testing.assert_array_equal(back.problem.mesh.cells, posed.mesh.cells)


def test_probabilities_are_those_of_the_evidence(wide: Diagnosis) -> None:
    first, second = wide.refits[:2]
    names = [f.hypothesis.effect.id for f in (first, second) if f.hypothesis.effect is not None]
    odds = wide.verdict.probability[names[0]] / wide.verdict.probability[names[1]]
    assert np.log(odds) == pytest.approx(first.log_evidence - second.log_evidence)
    p, library = wide.verdict.posterior, len(wide.screened)
    prior = log_prior(names[0], library, wide.rules) - log_prior(NONE, library, wide.rules)
    assert np.log(p[names[0]] / p[NONE]) == pytest.approx(first.log_evidence + prior)
    rows = {row["effect"]: row["log_evidence"] for row in plain(record(wide, "a case"))["ranking"]}
    assert np.log(odds) == pytest.approx(rows[names[0]] - rows[names[1]])


def test_a_second_effect_that_is_not_there_pays_for_itself(wide: Diagnosis) -> None:
    """What was looked at beside the cause is in the posterior, and no pair is as probable as the cause alone."""
    p = wide.verdict.posterior
    assert all(value < p["contour_bias"] for name, value in p.items() if "+" in name)
    assert [f.hypothesis.effect.id for f in wide.pairs if f.hypothesis.effect is not None] == [
        name for name in p if "+" in name
    ]


def test_the_model_checks_ask_of_the_leading_effect(wide: Diagnosis) -> None:
    """The cause passes; the plain model's stiffness alone, as if it were the effect, leaves more than noise."""
    cause = next(f for f in wide.refits if f.hypothesis.effect is not None and f.hypothesis.effect.id == "contour_bias")
    checks = {c.name: c.p_value for c in model_checks(wide.fit, cause, wide.split, wide.forces, wide.rules, 1)}
    assert checks["something_left"] > wide.rules.check_level and checks["unlike_its_name"] == 1.0
    still = replace(cause, linearisation=wide.fit.linearisation.with_phi(cause.phi), in_phi=0.0 * cause.in_phi)
    worse = {c.name: c.p_value for c in model_checks(wide.fit, still, wide.split, wide.forces, wide.rules, 1)}
    assert worse["something_left"] < wide.rules.check_level


def test_refits_are_kept_to_effects_worth_it(wide: Diagnosis) -> None:
    assert len(wide.refits) <= len(wide.screened)
    evidence = [r.log_evidence for r in wide.refits]
    assert evidence == sorted(evidence, reverse=True)


def test_the_numbers_in_force_are_in_the_record(none: Diagnosis) -> None:
    written = json.loads(json.dumps(plain(record(none, "a case"))["options"]))
    assert DiagnosisOptions.from_json(written) == DiagnosisOptions()
    assert written["decision_rules"]["sure"] == 0.9
    assert written["noise_model"]["landmark_mm"] == 0.45 and written["wall_motion"]["slide_share"] == 0.2


def test_other_numbers_of_noise_and_walls_are_taken_and_recorded(posed, none: Diagnosis) -> None:  # type: ignore[no-untyped-def]
    """A known size of voxels' noise, walls that may slide four times as far: fewer sizes, another covariance."""
    noise = NoiseModelOptions(own_mm=0.6, contour_prior=1e-3, points=4)
    fit = fit_plain([(posed, None)], options=noise, walls=WallMotionOptions(slide_share=0.8))
    assert len(fit.noise.sizes) == 8 < len(none.fit.noise.sizes)
    assert fit.sizes.per_mode == pytest.approx(0.6, rel=0.01)
    k = none.fit.model.first.data.n_modes
    wider, usual = (np.trace(f.weighting.covariance[:k, :k]) for f in (fit, none.fit))
    assert wider > 1.1 * usual
    written = plain(record(replace(none, fit=fit), "a case"))["options"]
    assert written["noise_model"]["own_mm"] == 0.6 and written["wall_motion"]["slide_share"] == 0.8


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match=r"numbers are not readable .*landmark_mm.*run diagnose again"):
        DiagnosisOptions.from_json({"noise_model": {"landmark_mm": "wide"}})
