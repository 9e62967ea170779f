"""The data of a deformed state: what stands in which row, and its derivatives against differences."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic_case import problem

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.matched_motion import MatchedMotion
from palpate.core.observe.contour_noise import leading_eigenpairs, smooth_covariance
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.noise_model_options import NoiseModelOptions

NUMBERS = NoiseModelOptions()
MARKS = np.array([[2.0, 1.0, 0.0, 2.1, 0.5, 0.2], [-4.0, 2.0, 3.0, -4.0, 1.0, 3.0]])
MOTION_AT = np.array([[2.0, 3.0, 1.0], [-12.0, 8.0, 2.0]])


class Bone:
    """Bones that are read as if the motion at one point were theirs."""

    residual_at_rest = np.arange(6.0)

    def residual(self, motion: Any) -> FloatArray:
        return np.concatenate([motion(np.zeros((1, 3)))[0], np.full(3, 9.0)])


BONE: Any = Bone()


@pytest.fixture(scope="module")
def scene() -> CompositionScene:
    matched = MatchedMotion(MOTION_AT, np.full((2, 3), 0.5), np.tile(np.eye(3) / 0.04, (2, 1, 1)), 10.0)
    posed = replace(problem(depth=3.0), matched=matched, landmarks=MARKS)
    return CompositionScene(SharedGeometry.of(posed, "p1p1"), Composition(posed))


@pytest.fixture(scope="module")
def data(scene: CompositionScene) -> DataVector:
    return DataVector.of(scene.observation, BONE, NUMBERS)


def motion(scene: CompositionScene, seed: int, size: float = 1.0) -> FloatArray:
    turn = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, 3))
    return size * np.sin(scene.space.nodes @ turn / 9.0)


def test_the_rows_are_modes_landmarks_motion_and_bones(scene: CompositionScene, data: DataVector) -> None:
    observation, u = scene.observation, motion(scene, 1)
    r = data.residual(scene, u)
    assert len(r) == data.n == data.n_modes + 6 + observation.motion.n + 6
    distance = observation.residual_of(observation.operator @ u)
    np.testing.assert_allclose(r[: data.n_modes], data.modes.T @ distance)
    moved = scene.space.interpolation(MARKS[:, :3], scene.problem.regions) @ u
    np.testing.assert_allclose(r[data.marks].reshape(-1, 3), MARKS[:, :3] + moved - MARKS[:, 3:])
    np.testing.assert_allclose(r[data.motion], observation.motion.residual(u))
    np.testing.assert_allclose(r[-6:], np.arange(6.0))
    assert data.n_motion == observation.motion.n == 6
    without = replace(data, bone=None)
    np.testing.assert_allclose(without.residual(scene, u), r[:-6])
    assert without.n == len(r) - 6


def test_a_wider_contour_and_bones_that_moved_are_those_of_the_composition(
    scene: CompositionScene, data: DataVector
) -> None:
    observation, u = scene.observation, motion(scene, 1)
    v, plain = observation.all_points @ u, data.residual(scene, u)
    wider = data.residual_of(observation, v, Composition(scene.problem).with_observation(0.7))
    np.testing.assert_allclose(wider - plain, 0.7 * data.dilation)
    np.testing.assert_allclose(data.dilation[: data.n_modes], data.modes.sum(axis=0))
    assert not data.dilation[data.n_modes :].any()
    moved = data.residual_of(observation, v, Composition(scene.problem).with_support(lambda X: X + [1.0, 2.0, 3.0]))
    np.testing.assert_allclose(moved[-6:], [1.0, 2.0, 3.0, 9.0, 9.0, 9.0])
    np.testing.assert_allclose(data.residual_of(observation, v)[-6:], np.arange(6.0))


def test_its_derivatives_are_those_of_differences(scene: CompositionScene, data: DataVector) -> None:
    u, step = motion(scene, 1), 1e-4
    moves = np.stack([motion(scene, seed) for seed in (2, 3)])
    found = data.response(scene, u, moves)
    for k, move in enumerate(moves):
        slope = (data.residual(scene, u + step * move) - data.residual(scene, u - step * move)) / (2.0 * step)
        np.testing.assert_allclose(found[:, k], slope, atol=2e-3 * np.abs(slope).max())
    np.testing.assert_allclose(np.einsum("jni,kni->jk", data.loads(scene, u), moves), found, atol=1e-9)
    assert data.response(scene, u, moves[:0]).shape == (data.n, 0)
    nothing: Any = None
    np.testing.assert_array_equal(data.in_theta(scene, nothing, SimpleNamespace(u=u), moves), found)  # type: ignore[arg-type]


def test_a_displacement_that_is_the_same_wherever_a_row_looks_is_read_at_its_place(
    scene: CompositionScene, data: DataVector
) -> None:
    u, whole = motion(scene, 1), np.array([0.3, -0.2, 0.5])
    everywhere = np.tile(whole, (scene.space.n_nodes, 1))
    places = data.per_place(scene, u)
    assert places.shape == (data.n, len(scene.observation.every_place), 3)
    np.testing.assert_allclose(places.sum(axis=1) @ whole, data.response(scene, u, everywhere[None])[:, 0], atol=1e-9)
    second = len(scene.observation.points) + 1
    at_mark = np.zeros((data.n, 3))
    at_mark[data.marks.start + 3 : data.marks.stop] = np.eye(3)
    np.testing.assert_array_equal(places[:, second], at_mark)


def test_modes_are_those_of_contour_noise_above_a_hundredth_of_the_largest(
    scene: CompositionScene, data: DataVector
) -> None:
    values, vectors = leading_eigenpairs(smooth_covariance(scene.observation.points, 1.0, NUMBERS.mode_length_mm))
    kept = values > 0.01 * values[0]
    assert data.n_modes == np.count_nonzero(kept) < len(values)
    # Between a hundredth of the first and of the second value there is a mode here: which of the two counts is seen.
    sharp = replace(NUMBERS, mode_least=float(1.001 * values[data.n_modes - 1] / values[0]))
    assert DataVector.of(scene.observation, BONE, sharp).n_modes == data.n_modes - 1
    np.testing.assert_array_equal(data.modes, vectors[:, kept])
    np.testing.assert_allclose(data.modes.T @ data.modes, np.eye(data.n_modes), atol=1e-9)
    assert DataVector.of(scene.observation, BONE, NUMBERS, organ_drawn=False).n_modes == 0
