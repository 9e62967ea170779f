"""Several deformed states of one body, diagnosed together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_case import problem
from triangle_shapes import ball

from palpate.core.diagnose.diagnose import diagnose
from palpate.core.diagnose.effects import library
from palpate.core.diagnose.verdict.judge import Diagnosis
from palpate.core.diagnose.verdict.record import maps, record
from palpate.core.files.json_types import plain
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.residual.case_data import CaseData, arrays, load
from palpate.core.residual.element_error import GOOD
from palpate.core.residual.noise_covariance import NoiseParts
from palpate.core.residual.noise_estimation import NoiseGrid
from palpate.core.surfaces.surface import Surface

EFFECTS = {k: v for k, v in library().items() if k in ("contour_bias", "compressible_organ")}
WIDER_MM = 0.6


def posed(depth: float, wider_mm: float = 0.0) -> IdentificationProblem:
    """What the scans would show if the plain model, with the better element and the wall's likeliest motion, were right."""
    found = problem(depth=depth)
    found = replace(found, facts=replace(found.facts, noise_sd_mm=0.08))
    scene = CompositionScene(SharedGeometry.of(found, GOOD), Composition(found))
    settled = scene.settle(np.log([30.0, 70.0])).equilibrium
    assert settled.converged
    rest = found.organ.rest
    at = rest.points + scene.space.interpolation(rest.points, found.regions) @ settled.u
    corners = at[rest.faces]
    normals = np.zeros_like(at)
    for k in range(3):
        np.add.at(normals, rest.faces[:, k], np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return replace(found, organ=SurfacePair(rest, replace(rest, points=at + wider_mm * normals)))


@pytest.fixture(scope="module")
def pair() -> tuple[IdentificationProblem, IdentificationProblem]:
    return posed(5.0), posed(3.0)


@pytest.fixture(scope="module")
def one(pair: tuple[IdentificationProblem, IdentificationProblem]) -> Diagnosis:
    return diagnose(CaseData(pair[0]), EFFECTS)


@pytest.fixture(scope="module")
def two(pair: tuple[IdentificationProblem, IdentificationProblem]) -> Diagnosis:
    return diagnose(CaseData(pair[0], more=((pair[1], None),)), EFFECTS)


@pytest.fixture(scope="module")
def wide(pair: tuple[IdentificationProblem, IdentificationProblem]) -> Diagnosis:
    """The second deformed scan's contour is too wide, the first one's is not."""
    return diagnose(CaseData(pair[0], more=((posed(3.0, WIDER_MM), None),)), EFFECTS)


def test_two_states_that_the_plain_model_predicts_have_no_gap_and_tell_the_stiffness_better(
    one: Diagnosis, two: Diagnosis
) -> None:
    assert two.verdict.verdict == "none"
    np.testing.assert_allclose(np.exp(two.fit.linearisation.theta), [30.0, 70.0], rtol=0.3)
    sd = [[s["sd_ln_G"] for s in plain(record(d, ""))["stiffness"]["without_effect"].values()] for d in (one, two)]
    assert (np.array(sd[1]) < sd[0]).all()


def test_what_is_wrong_in_one_state_alone_is_found_in_that_one(wide: Diagnosis) -> None:
    assert wide.test.detected
    assert "contour_bias" in wide.verdict.candidates
    best = next(f for f in wide.refits if f.hypothesis.effect is not None and f.hypothesis.effect.id == "contour_bias")
    np.testing.assert_allclose(best.phi, [0.0, WIDER_MM], atol=0.15)
    row = next(r for r in plain(record(wide, ""))["ranking"] if r["effect"] == "contour_bias")
    assert set(row["parameters"]) == {"offset", "offset_2"}
    gap = plain(record(wide, ""))["gap"]
    assert gap["states"][1]["rms_mm"] > 2.0 * gap["states"][0]["rms_mm"]


def test_a_cause_in_the_body_has_one_size_in_all_states(wide: Diagnosis) -> None:
    named = {s.effect.id: s for s in wide.screened}
    assert len(named["compressible_organ"].effect.parameters) == 1
    assert len(named["contour_bias"].effect.parameters) == 2
    # A state's own parameter moves that state's data alone.
    first, second = wide.fit.model.rows
    S = named["contour_bias"].directions[0]
    assert S[first, 0].any() and S[second, 1].any()
    assert not S[second, 0].any() and not S[first, 1].any()


def test_the_scan_at_rest_was_read_once(two: Diagnosis) -> None:
    """Half of two readings' variance is common to the states, and their walls' motions are not."""
    fit = two.fit
    first, second = fit.model.rows
    k = fit.model.first.data.n_modes
    a, b = slice(first.start, first.start + k), slice(second.start, second.start + k)
    parts = NoiseParts.of(fit.linearisation.each, fit.model.data_vectors, fit.options)
    for same in (parts.per_mode, parts.offset):
        np.testing.assert_allclose(same[a, b], 0.5 * same[a, a], atol=1e-12)
    alike = np.trace(parts.contour[2][a, b]) / np.trace(parts.contour[2][a, a])
    assert 0.3 < alike < 0.6  # the wall's part goes through two tangents
    assert parts.sliding[a, a].any() and not parts.sliding[a, b].any()
    np.linalg.cholesky(fit.weighting.covariance)
    # Members of the grid, which are kept as coefficients of a few matrices, are what the parts add up to.
    left = np.zeros((fit.model.rows[-1].stop, 1))
    again = NoiseGrid.of(parts, left, fit.linearisation.residual, fit.linearisation.in_theta, left)
    for size, member in list(zip(again.sizes, again.covariances, strict=True))[::7]:
        np.testing.assert_allclose(member, parts.covariance(size, left), rtol=1e-10, atol=1e-14)


def test_landmarks_share_what_was_read_at_rest(
    pair: tuple[IdentificationProblem, IdentificationProblem], two: Diagnosis
) -> None:
    """Points told by where they are at rest: one in both states, one in the second alone."""
    p, q = np.array([2.0, 1.0, 0.0]), np.array([-3.0, 0.0, 2.0])
    first = replace(pair[0], landmarks=np.hstack([p, p])[None])
    second = replace(pair[1], landmarks=np.stack([np.hstack([q, q]), np.hstack([p, p])]))
    found = diagnose(CaseData(first, more=((second, None),)), {})
    marks = NoiseParts.of(found.fit.linearisation.each, found.fit.model.data_vectors, found.fit.options).marks
    rows = found.fit.model.rows
    at = [
        slice(r.start + s.marks.start, r.start + s.marks.stop)
        for r, s in zip(rows, found.fit.model.data_vectors, strict=True)
    ]
    np.testing.assert_array_equal(marks[at[0], at[0]], np.eye(3))
    np.testing.assert_array_equal(marks[at[0], at[1]], np.hstack([np.zeros((3, 3)), 0.5 * np.eye(3)]))
    # All landmarks of all states are one more patch to leave out.
    assert found.split.n_patches == two.split.n_patches + 1
    assert (found.split.patch == found.split.n_patches - 1).sum() == 9


def test_patches_are_left_out_of_all_states_at_once(one: Diagnosis, two: Diagnosis) -> None:
    n = one.split.organ.stop
    assert two.split.organ.stop == 2 * n
    np.testing.assert_array_equal(two.split.patch[:n], two.split.patch[n : 2 * n])
    assert two.split.n_patches == one.split.n_patches


def test_maps_show_every_state(wide: Diagnosis) -> None:
    drawn = maps(wide)
    assert {"predicted/plain", "state_2/predicted/plain", "state_2/residual_mm", "state_2/offset/contour_bias"} <= set(
        drawn
    )
    assert drawn["state_2/offset/contour_bias"][0] == pytest.approx(WIDER_MM, abs=0.15)
    np.testing.assert_array_equal(drawn["points"], drawn["state_2/points"])
    assert np.abs(drawn["state_2/residual_mm"]).mean() > 2.0 * np.abs(drawn["residual_mm"]).mean()


def test_further_states_survive_their_file(
    pair: tuple[IdentificationProblem, IdentificationProblem], tmp_path: Path
) -> None:
    bones = SurfacePair(pair[0].organ.rest, pair[1].organ.deformed)
    np.savez(tmp_path / "data.npz", **arrays(CaseData(pair[0], None, more=((pair[1], bones), (pair[0], None)))))
    back = load(tmp_path / "data.npz")
    assert back.bones is None and len(back.more) == 2
    problem_2, bones_2 = back.more[0]
    assert bones_2 is not None and back.more[1][1] is None
    np.testing.assert_array_equal(bones_2.deformed.points, bones.deformed.points)
    np.testing.assert_array_equal(problem_2.organ.deformed.points, pair[1].organ.deformed.points)


def test_an_effect_over_one_state_is_itself() -> None:
    for effect in library().values():
        assert effect.over(1) is effect
    load = library()["unmodelled_load"].over(3)
    assert [p.state for p in load.parameters[:4]] == [0, 0, 0, None]
    assert [p.name for p in load.parameters[7:]] == [
        "pressure_2",
        "shear_1_2",
        "shear_2_2",
        "pressure_3",
        "shear_1_3",
        "shear_2_3",
    ]


def test_a_state_that_is_not_aligned_on_bone_is_said_to_be_so_and_the_other_is_not(
    pair: tuple[IdentificationProblem, IdentificationProblem],
) -> None:
    """All of the second deformed scan lies elsewhere, bones too; the first is aligned."""
    shift = np.array([1.0, -1.5, 0.8])

    def moved(surface: Surface) -> Surface:
        return replace(surface, points=surface.points + shift)

    bone = ball(24.0, (0.0, -40.0, 0.0))
    walls = {name: SurfacePair(p.rest, moved(p.deformed)) for name, p in pair[1].walls.items()}
    apart = replace(pair[1], walls=walls, organ=SurfacePair(pair[1].organ.rest, moved(pair[1].organ.deformed)))
    effects = {k: v for k, v in library().items() if k in ("bone_motion", "contour_bias")}
    found = diagnose(
        CaseData(pair[0], SurfacePair(bone, bone), more=((apart, SurfacePair(bone, moved(bone))),)), effects
    )
    assert found.verdict.verdict == "bone_motion"
    best = found.refits[0]
    np.testing.assert_allclose(best.phi[:3], 0.0, atol=0.3)
    np.testing.assert_allclose(best.phi[6:9], shift, atol=0.3)
