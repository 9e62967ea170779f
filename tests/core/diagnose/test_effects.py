"""Effects: nothing at phi = 0, the right first-order change beside it, and a thirteenth from a user's own file."""

from __future__ import annotations

from ast import literal_eval
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from law_derivatives import derivative_errors
from quick_model import THETA, quick_model, solved_plain
from synthetic_case import problem

from palpate.core.diagnose.effects import Surroundings, library
from palpate.core.diagnose.effects.compressible_organ import given_way, poisson_ratio
from palpate.core.diagnose.effects.tissue_stiffening import exponent
from palpate.core.diagnose.effects.unmodelled_load import _normal, _share
from palpate.core.diagnose.refit.pairs import joined, together
from palpate.core.errors import InputError
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.cut_interface import cut_problem
from palpate.core.forward.effect import Effect, Parameter, Variant
from palpate.core.forward.parameters import TISSUE
from palpate.core.forward.pressure_fields import pressure_fields
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.laws import LINEAR, MOONEY_RIVLIN
from palpate.core.laws.fibre import with_fibres
from palpate.core.laws.grown import grown
from palpate.core.residual.linearised_model import PLAIN, Hypothesis, Linearisation, StateModel
from palpate.validate.forward.random_scenes import random_deformation_gradients

IDS = set(library())
THIRTEENTH = """
from palpate.core.diagnose.effects import Effect, Parameter, Variant
from palpate.core.forward.material_changes import scaled

EFFECT = Effect(
    "stiffer_right_half", "the right half is stiffer than thought",
    (Parameter("log_factor", "1", 1.0),),
    lambda around: [Variant(lambda c, phi: c.with_law(scaled((2,), __import__("numpy").exp(phi[0]) * (c.problem.mesh.regions > 0))))],
    "nothing",
)
"""


@pytest.fixture(scope="module")
def model() -> StateModel:
    posed = problem(depth=3.0)
    rectum = posed.walls["rectum"]
    # A second hollow organ, so that prestress has what it needs: half of the same wall by another name.
    faces = posed.boundary["rectum"]
    boundary = {**posed.boundary, "rectum": faces[::2], "bladder": faces[1::2]}
    return quick_model(replace(posed, boundary=boundary, walls={"rectum": rectum, "bladder": rectum}))


@pytest.fixture(scope="module")
def plain(model: StateModel) -> Linearisation:
    return solved_plain(model)


def surroundings(model: StateModel, plain: Linearisation) -> Surroundings:
    return Surroundings(
        model.geometry.problem, (None, None), lambda: pressure_fields(model.geometry, plain.scene, THETA)
    )  # fmt: skip


def test_each_effect_of_the_library_can_be_there(model: StateModel, plain: Linearisation) -> None:
    effects = library()
    assert {"interface_sliding", "contour_bias", "prestress"} <= IDS
    assert all(effects[name].variants(surroundings(model, plain)) for name in IDS)


def test_at_zero_every_variant_is_the_very_plain_composition(model: StateModel, plain: Linearisation) -> None:
    for effect in library().values():
        for variant in effect.variants(surroundings(model, plain)):
            assert variant.applied(model.plain, np.zeros(len(effect.parameters))) is model.plain


@pytest.mark.parametrize("name", sorted(IDS - {"interface_sliding"}))
def test_a_direction_is_the_slope_of_the_solved_model(name: str, model: StateModel, plain: Linearisation) -> None:
    """One back-substitution against two full solves at small phi of either sign (one sign where the other is not allowed)."""
    effect = library()[name]
    hypothesis = Hypothesis(effect, effect.variants(surroundings(model, plain))[0])
    again = model.solve(PLAIN, THETA, np.zeros(0), plain)
    assert again is not None
    at = replace(again, phi=np.zeros(hypothesis.n))
    S = model.directions(hypothesis, at)[:, 0]
    h = np.zeros(hypothesis.n)
    h[0] = 0.02 * effect.parameters[0].scale
    high, low = (
        model.solve(hypothesis, THETA, sign * h, plain)
        for sign in (1.0, 0.0 if effect.parameters[0].low == 0 else -1.0)
    )
    assert high is not None and low is not None
    slope = (high.residual - low.residual) / (high.phi[0] - low.phi[0])
    assert np.linalg.norm(S) > 1e-6
    assert np.linalg.norm(S - slope) < 0.05 * np.linalg.norm(slope) + 2e-3


def _folding(side: int) -> Callable[[Composition, np.ndarray], Composition]:
    """Moves a node of the stress-free mesh, far through its cells' faces for phi of that sign, of either for 0."""

    def change(composition: Composition, phi: np.ndarray) -> Composition:
        mesh = composition.problem.mesh
        shift, node = np.zeros_like(mesh.points), mesh.region_boundary(tuple(composition.problem.regions))[0][0, 0]
        folds = side in (0, np.sign(phi[0]))
        shift[node] = [500.0, 500.0, 500.0] if folds else [0.1 * phi[0], 0.0, 0.0]
        return composition.with_geometry(shift)

    return change


def test_a_step_that_turns_a_cell_inside_out_is_taken_the_other_way(model: StateModel, plain: Linearisation) -> None:
    """It ended a whole diagnosis."""
    found = []
    for side in (2, 1, 0):  # never, upwards, both ways
        effect = Effect("moved", "a node moves", (Parameter("by", "mm", 1.0),), lambda around: [], "nothing")
        hypothesis = Hypothesis(effect, Variant(_folding(side)))
        found.append(model.directions(hypothesis, replace(plain, phi=np.zeros(1)))[:, 0])
        assert (model.solve(hypothesis, THETA, np.ones(1), plain) is None) == (side < 2)
    free, other_way, neither = found
    assert np.linalg.norm(free) > 1e-6
    assert np.linalg.norm(other_way - free) < 0.05 * np.linalg.norm(free)
    assert not neither.any()


@pytest.mark.parametrize(
    ("tilts", "towards"), [((0, 0), (1, 0, 0)), ((45, 0), (1, 1, 0)), ((0, -45), (1, 0, -1)), ((30, 0), (1, 0.577, 0))]
)
def test_tissue_is_uneven_across_a_plane_of_any_direction(
    tilts: tuple[float, float], towards: tuple[float, float, float], model: StateModel, plain: Linearisation
) -> None:
    around = surroundings(model, plain)
    (left,) = (v for v in library()["tissue_heterogeneity"].variants(around) if v.name == "left")
    materials = plain.scene.materials(THETA)
    changed = left.applied(model.plain, np.array([np.log(5.0), 3.0, *tilts])).materials(materials)
    mesh = model.plain.problem.mesh
    tissue = mesh.regions == TISSUE
    G = changed[TISSUE].per_cell(int(tissue.sum()))[:, 0] / materials[TISSUE].per_cell(int(tissue.sum()))[:, 0]
    axis = np.array(towards) / np.linalg.norm(towards)
    depth = (around.cell_centres[tissue] - around.organ_centre) @ axis
    assert G[depth > 13.0] == pytest.approx(5.0, rel=0.03)
    assert G[depth < -7.0] == pytest.approx(1.0, rel=0.03)
    assert G[(depth > 2.0) & (depth < 4.0)].mean() == pytest.approx(np.sqrt(5.0), rel=0.15)


def test_the_plane_of_uneven_tissue_lies_about_the_organ(model: StateModel, plain: Linearisation) -> None:
    """An organ 8 mm aside of the middle: what is 8 mm to its left, and no less, is behind a plane 4 mm from it."""
    around: Any = SimpleNamespace(
        cell_centres=surroundings(model, plain).cell_centres, organ_centre=np.array([8.0, 0.0, 0.0])
    )
    (left,) = (v for v in library()["tissue_heterogeneity"].variants(around) if v.name == "left")
    materials = plain.scene.materials(THETA)
    mesh = model.plain.problem.mesh
    tissue = mesh.regions == TISSUE
    count = int(tissue.sum())
    changed = left.applied(model.plain, np.array([np.log(5.0), -4.0, 0.0, 0.0])).materials(materials)[TISSUE]
    factor = changed.per_cell(count)[:, 0] / materials[TISSUE].per_cell(count)[:, 0]
    x = around.cell_centres[tissue, 0]
    assert factor[x > 12.0] == pytest.approx(5.0, rel=0.1) and factor[x < -6.0] == pytest.approx(1.0, rel=0.1)


def test_a_focus_is_a_ball_whose_place_size_and_contrast_are_its_parameters(
    model: StateModel, plain: Linearisation
) -> None:
    """At its middle all of the contrast, at its radius the root, a radius beyond it nothing."""
    centres = surroundings(model, plain).cell_centres
    around: Any = SimpleNamespace(
        cell_centres=centres, problem=model.plain.problem, spread_points=lambda points, spacing: np.zeros((1, 3))
    )
    (focus,) = library()["inclusion"].variants(around)
    mesh, materials = model.plain.problem.mesh, plain.scene.materials(THETA)
    phi = np.array([np.log(4.0), 2.0, -1.0, 0.5, -3.0])
    changed = focus.applied(model.plain, phi).materials(materials)
    radius = library()["inclusion"].parameters[4].physical(-3.0)
    assert radius == 4.5 and focus.where == (0.0, 0.0, 0.0) and focus.name == "at (0, 0, 0)"
    for region in (1, 2):
        inside = mesh.regions == region
        factor = changed[region].per_cell(int(inside.sum()))[:, 0] / materials[region].per_cell(int(inside.sum()))[:, 0]
        depth = radius - np.linalg.norm(centres[inside] - [2.0, -1.0, 0.5], axis=1)
        np.testing.assert_allclose(np.log(factor), np.log(4.0) / (1.0 + np.exp(-depth / 1.5)), rtol=1e-9)
    np.testing.assert_array_equal(changed[TISSUE].values, materials[TISSUE].values)


def test_fibres_run_along_thirteen_directions_of_unit_length_none_the_other_s_opposite(
    model: StateModel, plain: Linearisation
) -> None:
    a = np.array(
        [
            literal_eval(v.name.removeprefix("along "))
            for v in library()["fibre_anisotropy"].variants(surroundings(model, plain))
        ]
    )
    assert a.shape == (13, 3)
    np.testing.assert_allclose(np.linalg.norm(a, axis=1), 1.0, atol=0.01)
    alike = np.abs(a @ a.T) - np.eye(13)
    assert alike.max() < 0.9


def test_a_push_has_a_normal_profile_and_the_direction_of_the_surface_it_lies_on() -> None:
    at = np.array([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [0.0, 12.0, 0.0]])
    np.testing.assert_allclose(_share(at, np.zeros(3), 6.0), np.exp([0.0, -0.5, -2.0]))
    area = np.array([[0.0, 0.0, 2.0], [0.0, 1.0, 0.0], [5.0, 0.0, 0.0]])
    mean = np.array([5.0 * np.exp(-2.0), np.exp(-0.5), 2.0])
    np.testing.assert_allclose(_normal(at, area, np.zeros(3)), mean / np.linalg.norm(mean))


def test_parameters_are_told_in_their_units() -> None:
    effects = library()
    assert effects["unmodelled_load"].parameters[6].physical(1.5) == 7.5
    assert effects["inclusion"].parameters[0].physical(0.7) == 0.7
    assert {p.name: p.physical(0.0) for p in effects["interface_sliding"].parameters} == {"tangential_compliance": 0.0}


def test_a_cut_organ_that_is_held_alikemoves_like_an_uncut_one(model: StateModel, plain: Linearisation) -> None:
    held = CompositionScene(model.geometry, model.plain.with_interface(1e-9))
    found = held.settle(THETA).equilibrium
    assert found.converged
    n = len(model.geometry.problem.mesh.points)
    assert np.abs(found.u[:n] - plain.equilibrium.u).max() < 0.05
    cut = cut_problem(model.geometry.problem)
    np.testing.assert_array_equal(cut.original[:n], np.arange(n))
    np.testing.assert_allclose(cut.problem.mesh.points, model.geometry.problem.mesh.points[cut.original])


def test_sliding_moves_the_organ_along_its_surroundings(model: StateModel, plain: Linearisation) -> None:
    effect = library()["interface_sliding"]
    hypothesis = Hypothesis(effect, effect.variants(surroundings(model, plain))[0])
    slid = model.solve(hypothesis, THETA, np.array([3.0]), plain)
    assert slid is not None
    cut = model.geometry.cut
    inner = np.unique(cut.split.inner)
    jump = slid.equilibrium.u[inner] - slid.equilibrium.u[cut.original[inner]]
    radial = cut.problem.mesh.points[inner] / np.linalg.norm(cut.problem.mesh.points[inner], axis=1)[:, None]
    across = np.abs((jump * radial).sum(axis=1))
    assert np.linalg.norm(jump, axis=1).max() > 0.3
    assert across.mean() < 0.15 * np.linalg.norm(jump, axis=1).mean()


@pytest.mark.parametrize(
    "law", [grown(MOONEY_RIVLIN, 1.2), grown(LINEAR, 0.9), with_fibres(MOONEY_RIVLIN, np.array([0.6, 0.0, 0.8]))]
)
def test_laws_made_of_laws_have_the_right_derivatives(law) -> None:  # type: ignore[no-untyped-def]
    p = np.random.default_rng(0).uniform(5.0, 500.0, len(law.parameters))
    errors = derivative_errors(law, p, random_deformation_gradients(200, seed=1))
    assert max(errors.stress, errors.tangent) < 1e-7
    assert errors.parameter_linearity < 1e-12


def test_a_grown_body_is_free_of_stress_at_its_new_size() -> None:
    law, p = grown(MOONEY_RIVLIN, 1.331), np.array([4.0, 5.0, 300.0])
    assert np.abs(law.stress(1.1 * np.eye(3)[None], p)).max() < 1e-10
    assert np.abs(law.stress(np.eye(3)[None], p)).max() > 1.0


def test_a_thirteenth_effect_is_one_file_of_a_users_own(
    tmp_path: Path, model: StateModel, plain: Linearisation
) -> None:
    (tmp_path / "mine.py").write_text(THIRTEENTH)
    effect = library(tmp_path)["stiffer_right_half"]
    hypothesis = Hypothesis(effect, effect.variants(surroundings(model, plain))[0])
    again = model.solve(PLAIN, THETA, np.zeros(0), plain)
    assert again is not None
    S = model.directions(hypothesis, replace(again, phi=np.zeros(1)))
    # It is what the right half's own stiffness does.
    np.testing.assert_allclose(S[:, 0], again.in_theta[:, 1], atol=1e-3 * np.abs(S).max())


def test_the_example_of_the_docs_is_an_effect(tmp_path: Path, model: StateModel, plain: Linearisation) -> None:
    text = (Path(__file__).parents[3] / "docs" / "effects.md").read_text(encoding="utf-8")
    (tmp_path / "scar.py").write_text(text.split("```python\n")[1].split("```")[0])
    effect = library(tmp_path)["scar"]
    variants = effect.variants(surroundings(model, plain))
    assert len({v.where for v in variants}) == len(variants) > 1
    moved = model.solve(Hypothesis(effect, variants[0]), THETA, np.array([1.0]), plain)
    assert moved is not None and np.abs(moved.residual - plain.residual).max() > 1e-3


def test_a_users_file_that_is_no_effect_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("x = 1\n")
    with pytest.raises(InputError, match=r"mine\.py defines no EFFECT"):
        library(tmp_path)
    (tmp_path / "mine.py").write_text("def broken(:\n")
    with pytest.raises(InputError, match=r"mine\.py cannot be loaded \(SyntaxError"):
        library(tmp_path)
    (tmp_path / "mine.py").write_text(THIRTEENTH.replace("stiffer_right_half", "prestress"))
    with pytest.raises(InputError, match="'prestress' is taken"):
        library(tmp_path)


def test_two_effects_at_once_are_each_as_they_are_alone(model: StateModel, plain: Linearisation) -> None:
    effects = library()
    one, two = (effects[name].variants(surroundings(model, plain))[0] for name in ("bone_motion", "contour_bias"))
    pair = together(effects["bone_motion"], effects["contour_bias"])
    assert pair.id == "bone_motion+contour_bias"
    assert len(pair.parameters) == 7
    both = joined(one, two, 6)
    phi = np.array([1.0, -2.0, 0.5, 1.0, 0.0, 3.0, 0.7])
    X = model.geometry.problem.mesh.points[:5]
    made = both.applied(model.plain, phi)
    np.testing.assert_allclose(made.bone_motion(X), one.applied(model.plain, phi[:6]).bone_motion(X))
    assert made.observation == 0.7
    assert both.applied(model.plain, np.zeros(7)) is model.plain
    assert (
        two.applied(model.plain, phi[6:]).observation
        == both.applied(model.plain, phi * (np.arange(7) == 6)).observation
    )


def test_a_push_dents_the_organ_where_it_presses_and_may_be_moved(model: StateModel, plain: Linearisation) -> None:
    effect = library()["unmodelled_load"]
    again = model.solve(PLAIN, THETA, np.zeros(0), plain)
    assert again is not None
    points = model.geometry.observation.points
    for variant in effect.variants(surroundings(model, plain))[:3]:
        hypothesis = Hypothesis(effect, variant)
        S = model.directions(hypothesis, replace(again, phi=np.zeros(hypothesis.n)))
        assert not S[:, 3:].any()  # where and how wide say nothing while nothing presses
        moved = model.data.modes @ S[: model.data.n_modes, 0]
        deepest = points[np.argmin(moved)]
        assert moved.min() < 0.0
        assert np.linalg.norm(deepest - variant.where) < 8.0
    there = effect.parameters[3]
    assert there.name == "shift_x" and there.secondary


@pytest.mark.parametrize(("value", "name"), [(exponent, "tissue_stiffening"), (given_way, "compressible_organ")])
def test_effects_that_saturate_grow_exponentially_from_nothing(value: Callable[[float], float], name: str) -> None:
    assert value(0.0) == 0.0
    assert value(2.0) / value(1.0) == pytest.approx(np.e + 1.0)
    parameter = library()[name].parameters[0]
    assert parameter.low == 0.0
    assert value(parameter.high) > 5.0 * value(parameter.scale)


def test_poisson_ratio_falls_from_the_plain_model_s() -> None:
    """G / K = 3 (1 - 2 nu) / (2 (1 + nu)): what the ratio grows by gives back the nu of a law with that bulk modulus."""
    for phi in (0.0, 1.0, 2.5):
        nu = poisson_ratio(phi)
        assert 3.0 * (1.0 - 2.0 * nu) / (2.0 * (1.0 + nu)) == pytest.approx(3.0 * 0.01 / (2.0 * 1.495) + given_way(phi))


def test_bones_take_the_held_edge_along_near_them_or_all_of_it_or_not_at_all() -> None:
    posed = problem(depth=3.0)
    faces, _ = posed.mesh.boundary
    side = (posed.mesh.points[faces][:, :, 0] > 15.0 - 1e-6).all(axis=1)
    posed = replace(posed, boundary=posed.boundary | {"outer": faces[side]})
    geometry = SharedGeometry.of(posed, "p1p1")
    variants = library()["bone_motion"].variants(Surroundings(posed))
    assert len(variants) == 3
    bone, outer = (np.unique(posed.boundary[name]) for name in ("bone", "outer"))
    edge = np.setdiff1d(outer, bone)
    away = posed.mesh.points[edge, 1] + 15.0  # of the bone, which is the face y = -15 mm
    for variant, share in zip(
        variants, (np.zeros(len(edge)), np.exp(-0.5 * (away / 20.0) ** 2), np.ones(len(edge))), strict=True
    ):
        composition = variant.applied(Composition(posed), np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]))
        moved = CompositionScene(geometry, composition).prescribed.reshape(-1, 3)
        np.testing.assert_allclose(moved[bone], [[0.0, 0.0, 2.0]] * len(bone))
        np.testing.assert_allclose(moved[edge], share[:, None] * [0.0, 0.0, 2.0], atol=1e-12)
    free = replace(posed, facts=replace(posed.facts, outer_fixed=False))
    assert len(library()["bone_motion"].variants(Surroundings(free))) == 1
