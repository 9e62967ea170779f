"""The prediction of what a deformation would tell, before it has been scanned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_case

from palpate.core.fem.state import State
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.forward.slipping_walls import let_slip
from palpate.core.identify.predicted_posterior import predict
from palpate.core.observe.contour_noise import Weighting, noise_modes
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.noise_model_options import NoiseModelOptions
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
    options = NoiseModelOptions(own_mm=0.03, lengths_mm=(problem.facts.noise_correlation_mm,))
    told = predict(problem, TRUTH, element=ELEMENT, options=options)
    assert told.posterior is not None
    geometry = SharedGeometry.of(problem, ELEMENT)
    let_slip(geometry)
    scene = CompositionScene(geometry, Composition(problem))
    found = scene.settle(TRUTH).equilibrium
    data = DataVector.of(scene.observation, None, options)
    clean = data.residual(scene, found.u)
    in_theta = data.response(scene, found.u, scene.displacement_sensitivities(TRUTH, found))
    here = Linearisation(TRUTH, np.zeros(0), scene, found, clean, in_theta, np.zeros(0))
    parts = NoiseParts.of([here], [data], options)
    weights = Weighting(parts.covariance(NoiseSizes.of(options), np.zeros((data.n, 0))))
    slid, along = np.linalg.eigh(parts.sliding)
    facts, rng = problem.facts, np.random.default_rng(7)
    sd, length = np.sqrt(2.0) * facts.noise_sd_mm, facts.noise_correlation_mm
    organ = data.modes.T @ noise_modes(scene.observation.points, sd, length)
    modes = [noise_modes(wall.rest, sd, length) for wall in scene.walls]
    still, steps = scene.walls, []
    for _ in range(100):
        noise = [m @ rng.standard_normal(m.shape[1]) for m in modes]
        scene.walls = [replace(w, shift=w.shift + e) for w, e in zip(still, noise, strict=True)]
        moved = scene.solve(TRUTH, State(found.u, found.p))
        assert moved.converged
        residual = data.residual(scene, moved.u) - clean - organ @ rng.standard_normal(organ.shape[1])
        residual -= options.own_mm * rng.standard_normal(data.n)
        residual -= along @ (np.sqrt(np.maximum(slid, 0.0)) * rng.standard_normal(data.n))
        steps.append(np.linalg.lstsq(weights.whiten(in_theta), -weights.whiten(residual), rcond=None)[0])
    # 100 draws know a standard deviation to 7 %.
    np.testing.assert_allclose(np.std(steps, axis=0), told.posterior.sd, rtol=0.25)
