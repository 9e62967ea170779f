"""The stiffness map: its derivative, its limits, its honesty about what it does not know."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import synthetic_case

from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.identify.map import stiffness_map as module
from palpate.core.identify.map.patches import cut
from palpate.core.identify.map.smoothness_prior import SmoothPrior
from palpate.core.identify.map.stiffness_map import StiffnessMap, painted, stiffness_map
from palpate.core.observe.contour_noise import Weighting
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.plain_fit import PlainFit, fit_plain

TRUTH = np.log([25.0, 75.0])
Posed = tuple[PlainFit, CompositionScene, Equilibrium]


@cache
def made() -> IdentificationProblem:
    return synthetic_case.problem((25.0, 75.0))


def posed(noise_sd_mm: float) -> Posed:
    problem = made()
    problem = replace(problem, facts=replace(problem.facts, noise_sd_mm=noise_sd_mm))
    fit = fit_plain([(problem, None)], how=FitOptions(element="p1p1", starts=1))
    here = fit.linearisation.first
    return fit, here.scene, here.equilibrium


@pytest.fixture(scope="module")
def sharp() -> Posed:
    return posed(0.05)


@pytest.fixture(scope="module")
def mapped(sharp: Posed) -> StiffnessMap:
    return stiffness_map(*sharp, count=30)


def test_patches_fill_the_organ_once(sharp: Posed) -> None:
    mesh = sharp[1].problem.mesh
    patches = cut(mesh, (1, 2), 30)
    assert set(patches.cells) == set(np.flatnonzero(mesh.regions != 3))
    assert patches.n >= 25
    assert patches.volumes.sum() == pytest.approx(mesh.volumes[patches.cells].sum())
    again = cut(mesh, (1, 2), 30)
    np.testing.assert_array_equal(patches.patch, again.patch)
    linear = patches.means(mesh.points[mesh.cells[patches.cells]].mean(axis=1)[:, 0], mesh.volumes[patches.cells])
    np.testing.assert_allclose(linear, patches.centres[:, 0], atol=1e-12)


def test_derivative_by_finite_differences(sharp: Posed) -> None:
    fit, scene, found = sharp
    patches = cut(scene.problem.mesh, (1, 2), 12)
    body = module._Body(fit, scene, found, patches)
    m = patches.means(module._regional(scene, patches, TRUTH), scene.problem.mesh.volumes[patches.cells])
    here = body.at(m, found)
    assert here is not None
    J = body.jacobian(m, here.equilibrium)
    for k in (0, 7):
        step = 1e-4 * np.eye(patches.n)[k]
        ends = [body.at(m + s * step, here.equilibrium) for s in (1.0, -1.0)]
        assert ends[0] is not None and ends[1] is not None
        slope = (ends[0].residual - ends[1].residual) / 2e-4
        np.testing.assert_allclose(J[:, k], slope, atol=2e-4 * np.abs(slope).max())


def test_it_shows_the_stiffer_half_without_being_told_of_halves(mapped: StiffnessMap) -> None:
    x = mapped.patches.centres[:, 0]
    soft, stiff = mapped.ln_G[x > 3.0].mean(), mapped.ln_G[x < -3.0].mean()
    assert mapped.settled
    assert stiff - soft > 0.6 * np.log(3.0)
    error = (mapped.ln_G - np.where(x > 0.0, *TRUTH)) / mapped.sd
    away = np.abs(x) > 2.0  # a patch across the border has no one true value
    assert np.sqrt((error[away] ** 2).mean()) < 1.5


def test_noise_takes_the_map_back_to_the_prior(mapped: StiffnessMap) -> None:
    blind = stiffness_map(*posed(20.0), count=30)
    assert not blind.told.any()
    assert np.trace(blind.resolution) < 0.2 < 2.0 < np.trace(mapped.resolution)
    total = np.hypot(blind.prior.level_sd, blind.prior.local_sd)
    np.testing.assert_allclose(blind.sd, total, rtol=0.05)
    np.testing.assert_allclose(blind.ln_G, blind.prior.mean, atol=0.3)


def test_wider_noise_tells_less(sharp: Posed, mapped: StiffnessMap) -> None:
    fit, scene, found = sharp
    wider = replace(fit, weighting=Weighting(16.0 * fit.weighting.covariance))
    wide = stiffness_map(wider, scene, found, count=30)
    assert (wide.gain <= mapped.gain + 0.02).all()
    assert np.trace(wide.resolution) < np.trace(mapped.resolution)


def test_what_is_painted_passes_through_the_patches(mapped: StiffnessMap) -> None:
    G, told = painted(mapped.arrays(), mapped.patches.centres)
    np.testing.assert_allclose(np.log(G), mapped.ln_G, atol=1e-8)
    np.testing.assert_array_equal(told, mapped.told)


def test_spread_is_that_of_maps_of_simulated_bodies(sharp: Posed) -> None:
    """Bodies drawn from the prior, seen with noise, mapped by the linear estimator: squared errors average to what it says."""
    fit, scene, found = sharp
    patches = cut(scene.problem.mesh, (1, 2), 20)
    prior = SmoothPrior.of_bounds((20.0, 100.0))
    body = module._Body(fit, scene, found, patches)
    m = np.full(patches.n, np.log(45.0))
    here = body.at(m, found)
    assert here is not None
    J = body.jacobian(m, here.equilibrium)
    C = prior.covariance(patches.centres, patches.centres)
    judged = module._judged(body, patches, prior, m, J, C, np.linalg.inv(C), 1, True)
    rng = np.random.default_rng(3)
    H = np.linalg.inv(J.T @ J + np.linalg.inv(C))
    bodies = rng.multivariate_normal(np.zeros(patches.n), C, 4000, method="cholesky")
    noise = np.linalg.cholesky(fit.weighting.covariance) @ rng.standard_normal((len(J), 4000))
    errors = H @ (J.T @ (J @ bodies.T + fit.weighting.whiten(noise))) - bodies.T
    np.testing.assert_allclose(errors.var(axis=1), np.diag(judged.covariance), rtol=0.1)


def test_no_map_where_the_start_has_no_equilibrium(sharp: Posed, monkeypatch: pytest.MonkeyPatch) -> None:
    fit, scene, found = sharp
    monkeypatch.setattr(module._Body, "at", lambda *_: None)
    assert stiffness_map(fit, scene, found, count=10) is None
