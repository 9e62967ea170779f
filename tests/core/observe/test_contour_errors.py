"""Errors of one contour in two scans: covariance as drawn, even errors as before, what is common drops out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_case

from palpate.core.identify.predicted_posterior import predict
from palpate.core.inference.posterior import prior_precision
from palpate.core.observe.contour_errors import ContourErrors
from palpate.core.observe.contour_noise import smooth_covariance
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.surfaces.surface import Surface

LENGTH = 5.0
POINTS = np.random.default_rng(3).uniform(-12.0, 12.0, (40, 3))


def test_the_covariance_is_that_of_drawn_errors() -> None:
    random = np.random.default_rng(1)
    sd = np.stack([np.linspace(0.5, 2.0, 40), np.linspace(1.5, 0.8, 40)])
    errors = ContourErrors.sharing(POINTS, sd, 0.4)
    factor = np.linalg.cholesky(smooth_covariance(POINTS, 1.0, LENGTH) + 1e-9 * np.eye(40))
    common, rest, deformed = (factor @ random.standard_normal((40, 40000)) for _ in range(3))
    at_rest = sd[0][:, None] * (np.sqrt(0.4) * common + np.sqrt(0.6) * rest)
    later = sd[1][:, None] * (np.sqrt(0.4) * common + np.sqrt(0.6) * deformed)
    said = errors.covariance(errors, LENGTH, same_state=True)
    np.testing.assert_allclose(said, np.cov(later - at_rest), atol=0.12)
    other = sd[1][::-1][:, None] * (np.sqrt(0.4) * common + np.sqrt(0.6) * factor @ random.standard_normal((40, 40000)))
    second = ContourErrors.sharing(POINTS, np.stack([sd[0], sd[1][::-1]]), 0.4)
    across = np.cov(later - at_rest, other - at_rest)[:40, 40:]
    np.testing.assert_allclose(errors.covariance(second, LENGTH, same_state=False), across, atol=0.12)


def test_even_errors_are_two_contours() -> None:
    errors = ContourErrors.even(POINTS, 0.4)
    twice = 2.0 * smooth_covariance(POINTS, 0.4, LENGTH)
    np.testing.assert_array_equal(errors.covariance(errors, LENGTH, same_state=True), twice)
    np.testing.assert_array_equal(errors.covariance(errors, LENGTH, same_state=False), 0.5 * twice)


def test_errors_are_those_of_the_nearest_vertex() -> None:
    faces = np.array([[0, 1, 2]])
    rest = Surface(np.eye(3), faces, np.ones(1, dtype=np.int64), np.array([1.0, 2.0, 3.0]))
    pair = SurfacePair(rest, Surface(np.eye(3) + 5.0, faces, rest.region), 0.3)
    found = ContourErrors.of(pair, np.eye(3)[::-1], np.eye(3)[::-1] + 5.0, 0.4)
    np.testing.assert_allclose(found.rest, np.sqrt(0.7) * np.array([3.0, 2.0, 1.0]))
    np.testing.assert_allclose(found.deformed, np.sqrt(0.7) * 0.4)
    np.testing.assert_allclose(found.common, np.sqrt(0.3) * np.array([[3.0, 2.0, 1.0], [0.4, 0.4, 0.4]]))
    assert rest.with_points(rest.points + 1.0).sd_mm is rest.sd_mm


@pytest.mark.parametrize("to", ["rest", "deformed"])
def test_a_carried_surface_errs_as_its_source_and_by_what_carried_it(to: str) -> None:
    faces, first, second = np.array([[0, 1, 2]]), np.array([1.0, 2.0, 3.0]), np.full(3, 0.5)
    sd = (second, first) if to == "rest" else (first, second)
    rest, deformed = (Surface(np.eye(3), faces, np.ones(1, dtype=np.int64), one) for one in sd)
    errors = ContourErrors.of(SurfacePair(rest, deformed, carried_to=to), np.eye(3), np.eye(3), 0.4)
    np.testing.assert_array_equal(errors.common, [first, first])
    np.testing.assert_array_equal(errors.difference, second)
    np.testing.assert_array_equal(errors.rest, second if to == "rest" else 0.0 * second)
    np.testing.assert_allclose(np.diag(errors.covariance(errors, LENGTH, same_state=True)), second**2)


def _with_errors(
    problem: IdentificationProblem, organ: float, wall: float, common: float = 0.0
) -> IdentificationProblem:
    def stated(pair: SurfacePair, sd: float) -> SurfacePair:
        both = (replace(s, sd_mm=np.full(len(s.points), sd)) for s in (pair.rest, pair.deformed))
        rest, deformed = both
        return SurfacePair(rest, deformed, common)

    walls = {name: stated(pair, wall) for name, pair in problem.walls.items()}
    return replace(problem, organ=stated(problem.organ, organ), walls=walls)


def test_the_inference_stands_on_the_errors_that_surfaces_state() -> None:
    theta = np.log([30.0, 70.0])
    made = synthetic_case.problem((30.0, 70.0))
    plain = replace(made, facts=replace(made.facts, noise_sd_mm=0.3, noise_correlation_mm=7.0))
    assert not plain.states_errors and NoiseModelOptions().for_case(plain) == NoiseModelOptions()
    sds = {}
    for name, problem in {
        "assumed": plain,
        "the same": _with_errors(plain, 0.3, 0.3),
        "organ": _with_errors(plain, 1.5, 0.3),
        "wall": _with_errors(plain, 0.3, 1.5),
        "common": _with_errors(plain, 1.5, 0.3, 0.8),
    }.items():
        problem = IdentificationProblem.from_arrays(problem.arrays())
        found = predict(problem, theta, element="p1p1").posterior
        assert found is not None
        sds[name] = found.sd
    np.testing.assert_allclose(sds["the same"], sds["assumed"], rtol=0.02)
    assert (sds["organ"] > 2.0 * sds["assumed"]).all()
    assert (sds["wall"] > 1.04 * sds["assumed"]).all()
    # What both scans have in common cancels: of variances v in each, 2 (1 - 0.8) v remain of 2 v. The prior's part is taken out first.
    prior = prior_precision(np.log(np.array([plain.facts.bounds_kpa] * 2)))
    alone = {name: (sds[name] ** -2 - prior) ** -0.5 for name in ("organ", "common")}
    np.testing.assert_allclose(alone["common"] / alone["organ"], np.sqrt(0.2), rtol=0.15)
