"""The stiffness map: its derivative, what it says of uniform halves and of a focus, and that it agrees with the halves' own values."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import synthetic_case

from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import solve_equilibrium
from palpate.core.fem.state import State
from palpate.core.forward.parameters import TISSUE
from palpate.core.identify.map import local_field, places
from palpate.core.identify.map.local_field import Candidate, LocalField, Regional, candidates
from palpate.core.identify.map.patches import Patches, cut
from palpate.core.identify.map.sensitivities import patch_sensitivities
from palpate.core.identify.map.stiffness_map import StiffnessMap, called_at, nearest_patch, painted, stiffness_map
from palpate.core.identify.map.told_places import place_record
from palpate.core.identify.map.told_places import places as told_places
from palpate.core.observe.contour_noise import Weighting
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.plain_fit import PlainFit, fit_plain

NAMES = {1: "prostate_left", 2: "prostate_right"}


@cache
def fitted() -> PlainFit:
    """Uniform halves, seen by contours and in the images."""
    problem = synthetic_case.problem((25.0, 75.0))
    seen = replace(synthetic_case.matched(), moved=synthetic_case.moved(synthetic_case.matched().points, (25.0, 75.0)))
    return fit_plain([(replace(problem, matched=seen), None)], how=FitOptions(element="p2p1", starts=1))


@cache
def mapped() -> StiffnessMap:
    return of(fitted())


def of(fit: PlainFit, count: int = 30) -> StiffnessMap:
    here = fit.linearisation.first
    return stiffness_map(fit, [(here.scene, here.equilibrium)], count)


def halves(k: int) -> Patches:
    """Two halves of k cubes each, 8 mm wide, in a row."""
    centres = np.column_stack([8.0 * np.arange(2 * k), np.zeros((2 * k, 2))])
    return Patches(np.arange(2 * k), np.arange(2 * k), centres, np.full(2 * k, 512.0), np.repeat([1, 2], k))


def test_patches_fill_the_organ_once_and_no_patch_lies_in_both_halves() -> None:
    mesh = fitted().linearisation.first.scene.problem.mesh
    patches = cut(mesh, (1, 2), 30)
    assert set(patches.cells) == set(np.flatnonzero(mesh.regions != 3)) and patches.n >= 25
    np.testing.assert_array_equal(mesh.regions[patches.cells], patches.region[patches.patch])
    assert patches.volumes.sum() == pytest.approx(mesh.volumes[patches.cells].sum())
    np.testing.assert_array_equal(patches.patch, cut(mesh, (1, 2), 30).patch)
    np.testing.assert_allclose(patches.averages.sum(axis=1), 1.0)
    np.testing.assert_allclose(patches.averages @ patches.members, np.eye(2), atol=1e-12)


def test_derivative_by_finite_differences() -> None:
    fit = fitted()
    here, data = fit.linearisation.first, fit.model.data_vectors[0]
    mesh, materials = here.scene.problem.mesh, here.scene.parameters.materials(fit.linearisation.theta)
    patches = cut(mesh, (1, 2), 12)
    J = patch_sensitivities(fit, [(here.scene, here.equilibrium)], patches)

    def residual(patch: int, step: float) -> np.ndarray:
        factor = np.ones(len(mesh.regions))
        factor[patches.cells[patches.patch == patch]] = np.exp(step)
        changed = {TISSUE: materials[TISSUE]}
        for region in (1, 2):
            inside = mesh.regions == region
            values = materials[region].per_cell(int(inside.sum())) * factor[inside, None]
            changed[region] = Material(materials[region].law, values)
        start = State(here.equilibrium.u, here.equilibrium.p)
        found = solve_equilibrium(here.scene.assembler, changed, here.scene.prescribed, start)
        return fit.weighting.whiten(data.residual(here.scene, found.u))

    for patch in (0, 7):
        slope = (residual(patch, 1e-4) - residual(patch, -1e-4)) / 2e-4
        np.testing.assert_allclose(J[:, patch], slope, atol=5e-4 * np.abs(slope).max())
    here.scene.assembler.set_materials(materials)


def test_uniform_halves_are_mapped_as_uniform_and_agree_with_their_own_values() -> None:
    found, posterior = mapped(), fitted().posterior
    assert found.local.weights.argmax() == 0 and found.local.model.candidates[0].none
    assert found.local.uniform.min() > 0.8 and not found.called.any()
    average = found.patches.averages
    np.testing.assert_allclose(average @ found.ln_G, posterior.mean, atol=1e-9)
    np.testing.assert_allclose(average @ found.covariance @ average.T, posterior.covariance, atol=1e-9)
    np.testing.assert_allclose(found.ln_G, found.patches.members @ posterior.mean, atol=0.1)


def test_data_that_say_nothing_add_nothing_to_the_prior() -> None:
    fit = fitted()
    wide = replace(fit, weighting=Weighting(1e6 * fit.weighting.covariance))
    blind, found = of(wide), mapped()
    assert blind.local.model.added.max() < 0.05 < 0.3 < np.median(found.local.model.added)
    assert not blind.told.any() and not blind.called.any()
    assert blind.local.weights[0] == pytest.approx(local_field.NONE_ANYWHERE, abs=0.02)
    assert np.trace(blind.local.model.resolution) < 0.1 < np.trace(found.local.model.resolution)


def test_what_is_painted_passes_through_the_patches_and_stops_at_the_midline() -> None:
    found = mapped()
    centres, region = found.patches.centres, found.patches.region
    G, told = painted(found.arrays(), centres, region)
    np.testing.assert_allclose(np.log(G), found.ln_G, atol=1e-6)
    np.testing.assert_array_equal(told, found.told)
    seam = np.array([[0.0, 1.0, 0.0]])
    left, right = (painted(found.arrays(), seam, np.array([half]))[0][0] for half in (1, 2))
    assert right / left > 2.0, "a value of one half does not run into the other"
    assert region[nearest_patch(found.arrays(), seam, np.array([2]))] == 2
    elsewhere = nearest_patch(found.arrays(), seam, np.array([9]))
    np.testing.assert_array_equal(elsewhere, nearest_patch(found.arrays(), seam))


def test_a_file_from_before_the_map_knew_halves_is_still_painted() -> None:
    old = {key: mapped().arrays()[key] for key in ("centres", "ln_G", "sd", "told", "prior", "weights")}
    G, _ = painted(old, mapped().patches.centres, mapped().patches.region)
    np.testing.assert_allclose(np.log(G), mapped().ln_G, atol=1e-6)
    assert not called_at(old, mapped().patches.centres).any()


def test_candidates_are_as_likely_as_not_to_have_no_deviation() -> None:
    for regions in (1, 2):
        each = candidates(regions)
        assert sum(c.prior for c in each) == pytest.approx(1.0)
        assert [c.prior for c in each if c.none] == [local_field.NONE_ANYWHERE]


def test_restricted_likelihood_is_that_of_data_without_the_halves_values() -> None:
    """Against the density of contrasts that no value of the halves reaches, one candidate against another."""
    patches, rng = halves(4), np.random.default_rng(1)
    S, y = rng.normal(size=(8, 8)), rng.normal(size=8)
    some = (Candidate((0.0, 0.0), 6.0, 0.5), Candidate((0.5, 0.9), 12.0, 0.5))
    posterior = LocalField(patches, S, Regional(np.zeros(2), np.eye(2)), some).posterior(y)
    contrasts = np.linalg.qr(S @ patches.members, mode="complete")[0][:, 2:]
    logs = []
    for candidate in some:
        C = contrasts.T @ (np.eye(8) + S @ posterior.model.prior_covariance(candidate) @ S.T) @ contrasts
        z = contrasts.T @ y
        logs.append(-0.5 * (np.linalg.slogdet(C)[1] + z @ np.linalg.solve(C, z)))
    assert np.log(posterior.weights[1] / posterior.weights[0]) == pytest.approx(logs[1] - logs[0], abs=1e-9)


def test_posterior_is_that_of_bodies_drawn_from_the_prior() -> None:
    """Draws of the deviation, seen through noise, the halves' values known: squared errors average to what is said, and means and
    weights are those of draws."""
    patches, rng = halves(6), np.random.default_rng(2)
    S = 3.0 * rng.normal(size=(40, 12))
    H = np.zeros((2, 2))
    some = (Candidate((0.0, 0.0), 6.0, 0.5), Candidate((0.3, 0.3), 12.0, 0.5))
    field = LocalField(patches, S, Regional(np.zeros(2), H), some)
    root = np.linalg.cholesky(field.prior_covariance(some[1]) + 1e-12 * np.eye(12))
    errors, variances, uniform, probability = [], [], [], []
    for _ in range(400):
        varies = rng.random() < 0.5
        d = root @ rng.standard_normal(12) if varies else np.zeros(12)
        r = -S @ d + rng.standard_normal(40)
        posterior = field.posterior(r)
        errors.append(posterior.mean - d)
        variances.append(np.diag(posterior.covariance))
        uniform.append(not varies)
        probability.append(posterior.uniform[0])
    assert np.square(errors).mean() == pytest.approx(np.mean(variances), rel=0.15)
    assert np.mean(uniform) == pytest.approx(np.mean(probability), abs=0.06), "what is given 70 % happens in 70 %"
    draws = posterior.draws(20000, np.random.default_rng(3))
    np.testing.assert_allclose(draws.mean(axis=0), posterior.mean, atol=0.02)
    assert ((draws == 0.0).all(axis=1)).mean() == pytest.approx(posterior.weights[0], abs=0.02)


def focus(size: float, noise: np.ndarray) -> StiffnessMap:
    """Map of two halves of twelve places, the third of which is exp(size) times as stiff as the others of its half."""
    patches = halves(12)
    S = 4.0 * np.eye(24)
    J = S @ patches.members
    d = np.zeros(24)
    d[2] = size
    r = -S @ d + noise
    step = -np.linalg.solve(J.T @ J, J.T @ r)
    regional = Regional(np.log(40.0) + step, np.linalg.inv(J.T @ J))
    return StiffnessMap.of(LocalField(patches, S, regional).posterior(r + J @ step))


def test_a_focus_is_called_where_it_is_and_in_the_words_of_the_result() -> None:
    found = focus(2.0, np.zeros(24))
    assert found.called[2] == 1 and (found.called[12:] == 0).all()
    assert found.local.uniform[0] < 0.05 < 0.8 < found.local.uniform[1]
    first = place_record(told_places(found)[0], NAMES)
    assert (first.half, first.sense) == ("prostate_left", "stiffer")
    assert abs(first.centre_mm[0] - 16.0) < 12.0
    assert first.times == pytest.approx(np.exp(found.local.mean[2])) and first.times > 3.0
    assert first.ci95_kpa[0] < first.G_kpa < first.ci95_kpa[1]


def test_places_are_called_in_at_most_one_pair_in_twenty_without_a_focus() -> None:
    rng = np.random.default_rng(4)
    assert sum(focus(0.0, rng.standard_normal(24)).called.any() for _ in range(60)) <= 3


def test_a_call_asks_for_all_its_places_at_once() -> None:
    local = focus(2.0, np.zeros(24)).local
    strict, loose = places.called(local, 0.999), places.called(local, 0.5)
    assert (np.abs(strict) <= np.abs(loose)).all() and np.abs(loose).sum() > np.abs(strict).sum()
