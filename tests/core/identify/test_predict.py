"""The prediction of what a deformation would tell, before it has been scanned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_case

from palpate.core.fem.state import State
from palpate.core.forward.coupled_scene import CoupledScene, SceneOptions
from palpate.core.identify.misfit import Misfit, wall_response
from palpate.core.identify.predicted_posterior import predict
from palpate.core.observe.contour_noise import contour_covariance, noise_modes
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface

TRUTH = np.log([30.0, 70.0])
ELEMENT = "p1p1"


@pytest.fixture(scope="module")
def problem() -> IdentificationProblem:
    made = synthetic_case.problem((30.0, 70.0))
    return replace(made, facts=replace(made.facts, noise_sd_mm=0.3))


def test_the_deformed_organ_is_not_looked_at(problem: IdentificationProblem) -> None:
    still = replace(problem, organ=SurfacePair(problem.organ.rest, problem.organ.rest))
    seen, unseen = (predict(p, TRUTH, element=ELEMENT).posterior for p in (problem, still))
    assert seen is not None and unseen is not None
    np.testing.assert_allclose(seen.sd, unseen.sd, rtol=1e-9)


def test_half_the_deformation_tells_less(problem: IdentificationProblem) -> None:
    def partway(pair: SurfacePair) -> SurfacePair:
        rest, deformed = pair.rest, pair.deformed
        middle = Surface(0.5 * (rest.points + deformed.points), rest.faces, rest.region)
        return SurfacePair(rest, middle)

    same = all(len(w.rest.points) == len(w.deformed.points) for w in problem.walls.values())
    assert same, "the synthetic walls carry the same points in both states"
    whole = predict(problem, TRUTH, element=ELEMENT)
    half = predict(replace(problem, walls={n: partway(w) for n, w in problem.walls.items()}), TRUTH, element=ELEMENT)
    assert whole.posterior is not None and half.posterior is not None
    assert (half.posterior.sd > 1.4 * whole.posterior.sd).all()
    assert half.motion_mm == pytest.approx(0.5 * whole.motion_mm, rel=0.2)


def test_the_predicted_spread_is_that_of_a_hundred_noisy_scans(problem: IdentificationProblem) -> None:
    """One Gauss-Newton step from the truth for each of 100 draws of organ and wall noise, walls solved anew each time."""
    told = predict(problem, TRUTH, element=ELEMENT)
    assert told.posterior is not None
    scene = CoupledScene(problem, SceneOptions(element=ELEMENT))
    found = scene.settle(TRUTH).equilibrium
    misfit = Misfit.of(scene, wall_response(scene, found))
    jacobian = misfit.jacobian(found.u, scene.displacement_sensitivities(TRUTH, found))
    facts, rng = problem.facts, np.random.default_rng(7)
    sd, length = np.sqrt(2.0) * facts.noise_sd_mm, facts.noise_correlation_mm
    organ = np.linalg.cholesky(contour_covariance(scene.observation.points, facts.noise_sd_mm, length))
    modes = [noise_modes(wall.rest, sd, length) for wall in scene.walls]
    still, steps = scene.walls, []
    clean = misfit.residual(found.u)
    for _ in range(100):
        noise = [m @ rng.standard_normal(m.shape[1]) for m in modes]
        scene.assembler.terms = tuple(replace(w, shift=w.shift + e) for w, e in zip(still, noise, strict=True))
        moved = scene.solve(TRUTH, State(found.u, found.p))
        assert moved.converged
        seen = misfit.surface.whiten(organ @ rng.standard_normal(organ.shape[1]))
        residual = misfit.residual(moved.u) - clean
        residual[: len(seen)] -= seen
        steps.append(np.linalg.lstsq(jacobian, -residual, rcond=None)[0])
    # 100 draws know a standard deviation to 7 %.
    np.testing.assert_allclose(np.std(steps, axis=0), told.posterior.sd, rtol=0.25)
