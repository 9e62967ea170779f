"""Motion that images tell, as rows of the data vector: which directions count, their covariance, their derivative."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from quick_model import THETA, quick_model, solved_plain
from synthetic_case import problem

from palpate.core.fem.space import Space
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.known_geometry import KnownGeometry
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.forward.slipping_walls import let_slip
from palpate.core.inference.starts import middle
from palpate.core.matched_motion import MatchedMotion
from palpate.core.observe import motion_rows
from palpate.core.observe.motion_data import MotionData
from palpate.core.observe.motion_observation import MotionObservation
from palpate.core.observe.motion_rows import MotionRows, mode_reader, motion_in_mm
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.linearised_model import PLAIN, Linearisation, StateModel
from palpate.core.residual.noise_covariance import NoiseParts
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.window_scores import WindowScores

# In the ball, in the tissue beside it, and beyond the block, where there is no mesh.
PLACES = np.array([[2.0, 3.0, 1.0], [-12.0, 8.0, 2.0], [4.0, 40.0, 0.0]])


def edge(normal: np.ndarray, sd: float) -> np.ndarray:
    """Precision (3, 3) of a point on an edge: its normal is told, what lies along it is not."""
    return np.outer(normal, normal) / sd**2


def matched() -> MatchedMotion:
    tilted = np.array([0.6, 0.8, 0.0])
    precision = np.array([np.eye(3) / 0.2**2, edge(tilted, 0.1), np.eye(3)])
    return MatchedMotion(PLACES, np.full((3, 3), 0.5), precision, 10.0, np.ones((1, 6)), np.array([2]))


@pytest.fixture(scope="module")
def posed() -> IdentificationProblem:
    return replace(problem(depth=3.0), matched=matched())


@pytest.fixture(scope="module")
def model(posed: IdentificationProblem) -> StateModel:
    return quick_model(posed)


@pytest.fixture(scope="module")
def solved(model: StateModel) -> Linearisation:
    return solved_plain(model)


def test_a_direction_without_information_is_no_datum_and_a_point_outside_the_mesh_is_none(
    posed: IdentificationProblem,
) -> None:
    rows = MotionObservation.of(matched(), Space.of(posed.mesh, "p1p1")).rows
    assert rows.place.tolist() == [0, 0, 0, 1]
    np.testing.assert_allclose(np.abs(rows.as_a_whole[3]), [0.6, 0.8, 0.0], atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(rows.covariance)), [0.2, 0.2, 0.2, 0.1])


def test_neighbouring_windows_err_together(posed: IdentificationProblem) -> None:
    places = np.array([[0.0, 0, 0], [5.0, 0, 0], [0, -9.0, 0]])
    near = replace(matched(), points=places, precision=np.tile(np.eye(3), (3, 1, 1)))
    rows = MotionObservation.of(near, Space.of(posed.mesh, "p1p1")).rows
    C = rows.covariance
    x = np.flatnonzero(np.abs(rows.as_a_whole[:, 0]) > 0.5)
    assert C[x[0], x[1]] == pytest.approx(np.exp(-0.25), abs=0.01)
    assert abs(C[x[0], x[2]]) == pytest.approx(np.exp(-0.81), abs=0.01)
    assert np.linalg.eigvalsh(C).min() > 0.0


def test_modes_have_independent_errors_of_unit_size_and_lose_no_smooth_motion(posed: IdentificationProblem) -> None:
    random = np.random.default_rng(2)
    points = random.uniform(-9.0, 9.0, (60, 3))
    normals = random.standard_normal((60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    many = MatchedMotion(points, 0.0 * points, np.array([edge(n, 0.2) for n in normals]), 10.0)
    data = MotionData.of(many)
    reader = mode_reader(MotionRows.of_points(data))
    np.testing.assert_allclose(reader @ data.covariance() @ reader.T, np.eye(len(reader)), atol=1e-9)
    assert len(reader) < len(data.sd)
    smooth = data.components(np.sin(points[:, [1, 2, 0]] / 12.0))
    whole = smooth @ np.linalg.solve(data.covariance(), smooth)
    assert ((reader @ smooth) ** 2).sum() == pytest.approx(whole, rel=0.02)


def test_the_modes_lose_nothing_of_motions_that_they_are_told_to_show(
    posed: IdentificationProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fewer modes than there are smooth motions, and a motion with a kink: with it, its whole information is kept."""
    monkeypatch.setattr(motion_rows, "_MOST", 12)
    random = np.random.default_rng(5)
    points = random.uniform(-9.0, 9.0, (80, 3))
    many = MatchedMotion(points, 0.0 * points, np.tile(np.eye(3) / 0.2**2, (80, 1, 1)), 6.0)
    data = MotionData.of(many)
    rows = MotionRows.of_points(data)
    kink = data.components(np.abs(points[:, [1, 2, 0]]) - 4.0)
    smooth = data.components(np.ones_like(points))
    whole = kink @ np.linalg.solve(data.covariance(), kink)
    plain = mode_reader(rows)
    told = mode_reader(rows, np.stack([kink, smooth, 2.0 * kink, np.zeros_like(kink)], axis=1))
    assert len(plain) == 12
    assert ((plain @ kink) ** 2).sum() < 0.8 * whole
    assert ((told @ kink) ** 2).sum() == pytest.approx(whole, rel=1e-9)
    assert 13 <= len(told) <= 14
    np.testing.assert_allclose(told @ data.covariance() @ told.T, np.eye(len(told)), atol=1e-9)


def test_a_geometry_reads_the_images_for_what_the_stiffness_moves(posed: IdentificationProblem) -> None:
    geometry = SharedGeometry.of(posed, "p1p1")
    let_slip(geometry)
    motion = geometry.observation.motion
    scene = CompositionScene(geometry, Composition(posed))
    theta = middle(scene.parameters.bounds)
    sensitivities = scene.displacement_sensitivities(theta, scene.settle(theta).equilibrium)
    rows, C = motion.rows, motion.rows.covariance
    for moved, read in zip(sensitivities, motion.jacobian(sensitivities).T, strict=True):
        shown = rows.predicted(motion.operator @ moved)
        assert read @ read == pytest.approx(shown @ np.linalg.solve(C, shown), rel=1e-6)
    again = SharedGeometry.of(posed, "p1p1", known=KnownGeometry.from_arrays(geometry.known.arrays()))
    np.testing.assert_array_equal(again.observation.motion.reader, motion.reader)


def test_modes_are_read_back_as_motion_in_mm(posed: IdentificationProblem) -> None:
    """A smooth motion comes back, of every axis its own; where nothing was seen it is 0."""
    random = np.random.default_rng(2)
    points = np.vstack([random.uniform(-14.0, 14.0, (120, 3)), [[0.0, 0.0, 90.0]]])
    precision = np.tile(np.eye(3) / 0.05**2, (121, 1, 1))
    precision[-1] *= 1e-9
    data = MotionData.of(MatchedMotion(points, 0.0 * points, precision, 1.0))
    rows = MotionRows.of_points(data)
    reader = mode_reader(rows)
    smooth = np.sin(points[:, [1, 2, 0]] / [12.0, 15.0, 18.0]) * [1.0, -2.0, 0.5]
    found = motion_in_mm(rows, reader) @ (reader @ data.components(smooth))
    assert found.shape == (len(rows.places), 3)
    near = np.linalg.norm(rows.places, axis=1) < 12.0
    np.testing.assert_allclose(found[near], smooth[: len(found)][near], atol=0.15)
    alone = np.flatnonzero(rows.places[:, 2] > 50.0)
    assert np.abs(found[alone]).max(initial=0.0) < 0.01


def test_the_residual_is_predicted_minus_matched_along_what_is_told(
    posed: IdentificationProblem, model: StateModel, solved: Linearisation
) -> None:
    motion = model.geometry.observation.motion
    u = motion.operator @ solved.equilibrium.u
    expected = motion.reader @ np.array([motion.rows.as_a_whole[k] @ (u[p] - 0.5) for k, p in enumerate([0, 0, 0, 1])])
    np.testing.assert_allclose(solved.residual[model.data.motion], expected)
    assert np.abs(expected).max() > 0.1
    assert model.data.n == model.data.n_modes + 4
    without = SharedGeometry.of(replace(posed, matched=None), "p1p1").observation
    assert DataVector.of(without, None, NoiseModelOptions()).n == model.data.n_modes


def test_the_derivative_is_the_slope_of_the_solved_model(model: StateModel, solved: Linearisation) -> None:
    h = np.array([0.02, 0.0])
    ends = [model.solve(PLAIN, THETA + sign * h, np.zeros(0), solved) for sign in (1.0, -1.0)]
    assert ends[0] is not None and ends[1] is not None
    slope = (ends[0].residual - ends[1].residual)[model.data.motion] / 0.04
    assert np.linalg.norm(slope) > 1e-3
    np.testing.assert_allclose(solved.in_theta[model.data.motion, 0], slope, atol=0.03 * np.abs(slope).max())


def test_its_covariance_is_a_part_of_the_noise(model: StateModel, solved: Linearisation) -> None:
    noise = NoiseParts.of([solved], [model.data], NoiseModelOptions())
    rows = model.data.motion
    np.testing.assert_allclose(noise.floor[rows, rows], np.eye(4))
    # A wall whose contour is off moves tissue too: those errors reach the matched rows.
    assert np.diag(noise.contour[0])[rows].min() > 0.0


def test_a_problem_keeps_it_in_its_file(posed: IdentificationProblem) -> None:
    again = IdentificationProblem.from_arrays(posed.arrays()).matched
    assert again is not None
    np.testing.assert_array_equal(again.precision, matched().precision)
    np.testing.assert_array_equal(again.rejected_for, [2])
    assert IdentificationProblem.from_arrays(replace(posed, matched=None).arrays()).matched is None


def scores() -> WindowScores:
    """Two windows that see the mean of two places each, the second with a place beyond the block."""
    nodes = np.array([[0.0, 0, 0], [4.0, 0, 0], [-6.0, 2, 0], [4.0, 60.0, 0]])
    half = sp.csr_matrix(np.kron([[0.5, 0.5, 0, 0], [0, 0, 0.5, 0.5], [0.5, 0, 0.5, 0]], 5.0 * np.eye(3)))
    pairs = np.array([[0, 0], [1, 1], [2, 2], [0, 2]])
    blocks = np.array([1.0, 1.0, 1.0, 0.4])[:, None, None] * np.eye(3)
    middles = np.array([[2.0, 0, 0], [0, 30.0, 0], [-3.0, 1, 0]])
    return WindowScores(middles, nodes, half, np.arange(9.0), pairs, blocks)


def test_a_window_reads_the_motion_of_all_places_that_it_sees(posed: IdentificationProblem) -> None:
    space = Space.of(posed.mesh, "p2p1")
    motion = MotionObservation.of(replace(matched(), scores=scores()), space)
    assert motion.rows.place.tolist() == [0, 0, 0, 1, 1, 1]  # the window that looks out of the mesh is no datum
    np.testing.assert_array_equal(motion.rows.value, [0, 1, 2, 6, 7, 8])
    assert motion.rows.covariance[0, 3] == pytest.approx(0.4)
    u = np.sin(space.nodes[:, [1, 2, 0]] / 9.0)
    v = space.interpolation(scores().nodes) @ u
    seen = 2.5 * np.concatenate([v[0] + v[1], v[0] + v[2]])
    np.testing.assert_allclose(motion.residual(u), motion.reader @ (seen - motion.rows.value))
    np.testing.assert_allclose(np.einsum("mni,ni->m", motion.per_node, u), motion.reader @ seen)
    np.testing.assert_allclose(
        motion.per_place.sum(axis=1), motion.reader @ np.tile(5.0 * np.eye(3), (2, 1)), atol=1e-12
    )


def test_a_problem_keeps_the_windows_scores(posed: IdentificationProblem) -> None:
    kept = IdentificationProblem.from_arrays(
        replace(posed, matched=replace(matched(), scores=scores())).arrays()
    ).matched
    assert kept is not None and kept.scores is not None
    np.testing.assert_array_equal(kept.scores.response.toarray(), scores().response.toarray())
    np.testing.assert_array_equal(kept.scores.covariance, scores().covariance)


def test_scores_have_the_same_arrays_before_and_after_they_are_used(posed: IdentificationProblem) -> None:
    """A fit is kept under a hash of these arrays; scipy sorts the columns of a row in place when it first needs them so."""
    stored = scores().arrays()
    columns, values = stored["columns"].copy(), stored["response"].copy()
    for first, last in zip(stored["starts"][:-1], stored["starts"][1:], strict=True):
        columns[first:last], values[first:last] = columns[first:last][::-1], values[first:last][::-1]
    loaded = WindowScores.from_arrays(stored | {"columns": columns, "response": values})
    before = {name: array.copy() for name, array in loaded.arrays().items()}
    _ = MotionObservation.of(replace(matched(), scores=loaded), Space.of(posed.mesh, "p2p1")).per_node
    loaded.response.sort_indices()
    for name, array in loaded.arrays().items():
        np.testing.assert_array_equal(array, before[name])
        np.testing.assert_array_equal(array, stored[name])
