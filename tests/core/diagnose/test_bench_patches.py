"""Patches of a body on a bench: forces as in a textbook, derivatives, errors that they add, and a focus that is found."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bench_blocks import block, block_mesh, faces_at, seen, with_focus
from schemas import check_form

from palpate.core.diagnose.bench_bodies import model as bench
from palpate.core.diagnose.bench_bodies.diagnose import diagnose_body
from palpate.core.diagnose.bench_bodies.fit import _moves_patches, fit_body
from palpate.core.diagnose.bench_bodies.judge import judged
from palpate.core.diagnose.bench_bodies.model import bench_model, marker_data, noise_covariance
from palpate.core.diagnose.bench_bodies.problem import BodyPatch, BodyProblem, BodyState, PatchFacts
from palpate.core.diagnose.effects import library
from palpate.core.files.json_types import plain

LENGTH, DEPTH, HEIGHT = 60.0, 24.0, 36.0
G, POISSON = 30.0, 0.495
NONE_HELD = np.zeros((0, 3), dtype=np.int64)


def bar_pulled_by(moved_mm: float, sd_mm: float = 0.0, force_n: float = 0.0) -> BodyProblem:
    """A bar on rollers, free to grow thinner, whose end is pulled along x."""
    mesh = block_mesh((4, 2, 2))
    roller = [
        BodyPatch(faces_at(mesh, axis, 0.0), PatchFacts(name, held))
        for axis, name, held in ((0, "foot", (0.0, None, None)), (1, "side", (None, 0.0, None)), (2, "floor", (None, None, 0.0)))
    ]  # fmt: skip
    facts = PatchFacts("grip", (moved_mm, None, None), (sd_mm, 0.0, 0.0), (force_n, None, None), (0.01, None, None), 0)
    rest = ((30.0, 24.0, 36.0), (45.0, 10.0, 36.0))
    state = BodyState("pulled", rest, ((30.0, None, 36.0), (45.0, None, 36.0)), (0.1, None, 0.1), (0.0, 0.0, 0.0))
    patches = (*roller, BodyPatch(faces_at(mesh, 0, LENGTH), facts))
    return BodyProblem(mesh, NONE_HELD, (state,), 1000.0, (5.0, 500.0), True, patches)


def test_a_bar_that_a_patch_pulls_needs_the_textbooks_force_and_grows_thinner() -> None:
    strain = 1e-4
    model = bench_model(bar_pulled_by(strain * LENGTH), "p2p1", 0.7)
    solved = model.plain(np.log([G]), None)
    assert solved is not None
    E = 2.0 * G * (1.0 + POISSON)
    assert solved.residual[-1] == pytest.approx(E * DEPTH * HEIGHT * strain / 1000.0, rel=1e-3)
    moved = marker_data(model)[0].missed(solved.residual)  # they are seen where they were at rest
    np.testing.assert_allclose(moved[:, 0], strain * np.array([30.0, 45.0]), rtol=1e-6)
    np.testing.assert_allclose(moved[:, 2], -POISSON * strain * HEIGHT, rtol=1e-3)
    assert np.isnan(moved[:, 1]).all()


def test_a_load_on_rollers_is_carried_by_their_reaction() -> None:
    """The force of the floor is the block's weight."""
    problem = bar_pulled_by(0.0)
    floor = replace(problem.patches[2].facts, reaction_n=(None, None, 0.0), reaction_sd_n=(None, None, 0.1))
    patches = (*problem.patches[:2], replace(problem.patches[2], facts=floor), problem.patches[3])
    state = replace(problem.states[0], gravity=(0.0, 0.0, -9.81))
    solved = bench_model(replace(problem, patches=patches, states=(state,)), "p2p1", 0.7).plain(np.log([G]), None)
    assert solved is not None
    weight = 1000.0 * 9.81 * LENGTH * DEPTH * HEIGHT * 1e-9
    assert solved.residual[-2] == pytest.approx(weight, rel=1e-6)


def test_reactions_and_markers_change_with_the_stiffness_as_their_derivative_says() -> None:
    """Large strain, a disc that shears the block: adjoint of the reactions against finite differences."""
    problem = replace(block((4, 2, 3)), model_gravity=True, density_kg_m3=1000.0)
    problem = replace(problem, states=tuple(replace(s, gravity=(3.0, 1.0, -9.0)) for s in problem.states))
    model, h = bench_model(problem, "p2p1", 0.7), 1e-4
    here = model.plain(np.log([G]), None)
    assert here is not None
    high, low = (model.plain(np.log([G]) + step, here) for step in (h, -h))
    assert high is not None and low is not None
    expected = (high.residual - low.residual) / (2.0 * h)
    reactions = np.concatenate([np.arange(r.stop - 2, r.stop) for r in model.rows])
    assert (np.abs(expected[reactions]) > 1e-2).all()
    np.testing.assert_allclose(here.in_theta[:, 0], expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("sd_mm", [0.0, 0.01])
def test_the_noise_hangs_on_the_stiffness_where_what_was_prescribed_may_be_wrong(sd_mm: float) -> None:
    assert _moves_patches(bar_pulled_by(1.0, sd_mm)) == (sd_mm > 0.0)


def test_a_patch_s_rim_is_in_it_where_it_was_not_and_the_other_way_round() -> None:
    faces, rim = np.array([[0, 1, 2], [3, 4, 5], [6, 7, 8]]), np.array([[3, 4, 5], [9, 10, 11], [12, 13, 14]])
    patch = BodyPatch(faces, PatchFacts("disc", (0.0, None, None)), rim)
    assert patch.with_rim_toggled(np.zeros(3, dtype=bool)).faces.tolist() == faces.tolist()
    toggled = patch.with_rim_toggled(np.array([True, True, False]))
    assert toggled.faces.tolist() == [[0, 1, 2], [6, 7, 8], [9, 10, 11]]
    alone = replace(patch, faces=rim[:1]).with_rim_toggled(np.array([True, False, False]))
    assert alone.faces.shape == (0, 3)


def test_where_a_patch_ends_is_an_error_of_a_third_of_its_draws_variance(monkeypatch: pytest.MonkeyPatch) -> None:
    """The data change by 3 and -6 where the one face of the rim is the patch's; no patch may lose all its faces."""
    change, solved = np.array([3.0, -6.0]), []
    faces, rim = np.array([[0, 1, 2]]), np.array([[3, 4, 5]])
    patch = BodyPatch(faces, PatchFacts("disc", (0.0, None, None)), rim)
    problem = replace(bar_pulled_by(1.0), patches=(patch,))

    def drawn(problem: BodyProblem, element: str, common: float) -> Any:
        inside = len(problem.patches[0].faces) > 1
        solved.append(inside)
        return SimpleNamespace(plain=lambda theta, near: SimpleNamespace(residual=1.0 + inside * change))

    model: Any = SimpleNamespace(n=2, first=SimpleNamespace(geometry=SimpleNamespace(element="p1p1")))
    at: Any = SimpleNamespace(theta=None, residual=np.ones(2))
    monkeypatch.setattr(bench, "bench_model", drawn)
    monkeypatch.setattr(bench, "marker_data", lambda model: [SimpleNamespace(common=0.7)])
    found = bench._by_rims(problem, model, at)
    share = np.mean(solved)
    assert 0.0 < share < 1.0
    np.testing.assert_allclose(np.diag(found), share * change**2 / 3.0)
    assert found[0, 1] < 0.0
    without = replace(problem, patches=(replace(patch, rim=rim[:0]),))
    np.testing.assert_array_equal(bench._by_rims(without, model, at), np.zeros((2, 2)))
    only_rim = replace(problem, patches=(BodyPatch(rim, patch.facts, rim),))
    solved.clear()
    assert not bench._by_rims(only_rim, model, at).any() and not any(solved)


def test_data_change_with_the_displacements_as_their_derivative_says() -> None:
    """Markers and a reaction, at a state under strain, along a smooth motion; the materials stay."""
    model = bench_model(bar_pulled_by(4.0), "p2p1", 0.7)
    at, data = model.plain(np.log([G]), None), marker_data(model)[0]
    assert at is not None
    scene, u = at.first.scene, at.first.equilibrium.u
    move, h = np.sin(scene.space.nodes[:, [0, 2, 1]] / 20.0), 1e-3
    expected = (data.residual(scene, u + h * move) - data.residual(scene, u - h * move)) / (2.0 * h)
    (found,) = data.response(scene, u, move[None]).T
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert np.abs(expected[-1]) > 1e-3
    np.testing.assert_allclose(data.response(scene, u, 100.0 * move[None])[:, 0], 100.0 * expected, rtol=1e-4)


def test_the_error_of_a_displacement_is_carried_to_the_data() -> None:
    """A bar whose end may be off by 0.01 mm: the force by E A / L of that, the middle by half."""
    problem = bar_pulled_by(0.006, sd_mm=0.01)
    model = bench_model(problem, "p2p1", 0.7)
    solved = model.plain(np.log([G]), None)
    assert solved is not None
    own = noise_covariance(problem, model, solved) - marker_data(model)[0].covariance
    force = 2.0 * G * (1.0 + POISSON) * DEPTH * HEIGHT / LENGTH / 1000.0 * 0.01
    assert own[-1, -1] == pytest.approx(force**2, rel=0.01)
    assert own[0, 0] == pytest.approx(0.005**2, rel=0.01)
    assert own[0, -1] == pytest.approx(0.005 * force, rel=0.01)


def test_a_force_tells_the_stiffness_that_displacements_alone_do_not() -> None:
    """A body that is only displaced shows the same motion whatever its stiffness."""
    strain, truth = 1e-4, 40.0
    force = 2.0 * truth * (1.0 + POISSON) * DEPTH * HEIGHT * strain / 1000.0
    facts = replace(bar_pulled_by(strain * LENGTH).patches[3].facts, reaction_sd_n=(0.005 * force, None, None))
    problem = bar_pulled_by(strain * LENGTH, force_n=force)
    with_force = replace(facts, reaction_n=(force, None, None))
    told = fit_body(replace(problem, patches=(*problem.patches[:3], replace(problem.patches[3], facts=with_force))))
    assert np.exp(told.plain.posterior.mean[0]) == pytest.approx(truth, rel=1e-3)
    assert told.plain.posterior.sd[0] == pytest.approx(0.005, rel=0.05)
    without = replace(facts, reaction_n=(None, None, None), reaction_sd_n=(None, None, None))
    untold = fit_body(replace(problem, patches=(*problem.patches[:3], replace(problem.patches[3], facts=without))))
    assert untold.plain.posterior.sd[0] > 1.0
    assert "tell nothing of the stiffness" in diagnose_body(untold.problem, {}, "bar")[0].flags[0]
    assert not diagnose_body(told.problem, {}, "bar")[0].flags


@pytest.mark.nightly
def test_a_block_without_an_effect_has_no_gap_on_a_mesh_that_is_not_the_truths() -> None:
    """Its disc is made of other faces than the true one's: that error is counted."""
    problem = seen(block(), 15.0)
    fit = fit_body(problem)
    assert judged(fit, {}).found.test.p_value > 0.05
    posterior = fit.plain.posterior
    assert abs(posterior.mean[0] - np.log(15.0)) < 3.0 * posterior.sd[0]


@pytest.mark.nightly
def test_a_stiff_focus_ranks_first_by_markers_in_a_plane_moves_and_forces() -> None:
    centre = (22.0, 9.0, 20.0)
    found, maps = diagnose_body(seen(block(), 15.0, with_focus(centre, 8.0, 4.0)), library(), "block")
    found = plain(found)
    check_form(found, "diagnosis")
    assert found["gap"]["detected"]
    assert found["ranking"][0]["effect"] == found["verdict"] == "inclusion"
    assert found["ranking"][0]["parameters"]["log_contrast"]["value"] > 0.7
    assert found["stiffness"]["with_effect"]["body"]["G_kpa"] == pytest.approx(15.0, rel=0.1)
    assert found["states"][0]["rms_after_mm"] < found["states"][0]["rms_before_mm"]
    first = found["states"][0]["reactions"][1]
    assert (first["patch"], first["axis"]) == ("disc", "z")
    assert abs(first["after_n"] - first["measured_n"]) < 0.05 * abs(first["measured_n"])
    assert np.isnan(maps["state_1/residual"][:, 1]).all()
