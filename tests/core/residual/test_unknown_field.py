"""A discrepancy without a name: forces near the organ of a stated size, and what they do to the data of a solved model."""

from __future__ import annotations

import numpy as np
import pytest
from quick_model import quick_model, solved_plain
from synthetic_case import problem

from palpate.core.fem.sensitivity import response_to_forces
from palpate.core.observe.contour_noise import smooth_covariance
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.joint_states import JointLinearisation
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.unknown_field import ForceFields, UnknownDiscrepancy

NUMBERS = NoiseModelOptions(force_length_mm=8.0)


@pytest.fixture(scope="module", params=[True, False], ids=["drawn", "images alone"])
def solved(request: pytest.FixtureRequest) -> tuple[Linearisation, DataVector]:
    model = quick_model(problem(depth=3.0), NUMBERS, organ_drawn=request.param)
    return solved_plain(model), model.data


def test_independent_forces_of_unit_size_move_the_surface_as_far_as_is_typical(
    solved: tuple[Linearisation, DataVector],
) -> None:
    at, data = solved
    found = ForceFields.around(at, data, NUMBERS)
    moves = response_to_forces(at.tangent, found.fields)
    np.testing.assert_allclose(found.response, data.response(at.scene, at.equilibrium.u, moves), atol=1e-9)
    observation = at.scene.observation
    along = np.stack([((observation.operator @ move) * observation.normals).sum(axis=1) for move in moves])
    typical = np.sqrt(np.square(along).sum() / len(observation.points))
    # What is drawn is read along the deformed normals and without what is finer than contour noise.
    assert typical == pytest.approx(NUMBERS.force_typical_mm, rel=0.15 if data.n_modes else 1e-9)
    if data.n_modes:
        rows = np.square(found.response[: data.n_modes]).sum() / len(observation.points)
        assert np.sqrt(rows) == pytest.approx(NUMBERS.force_typical_mm)


def test_forces_act_near_the_organ_and_their_density_is_per_volume(solved: tuple[Linearisation, DataVector]) -> None:
    at, data = solved
    found = ForceFields.around(at, data, NUMBERS)
    mesh, nodes = at.scene.space.mesh, at.scene.space.nodes
    assert found.share.sum() == pytest.approx(mesh.volumes.sum())
    organ = at.scene.observation.points
    far = ((nodes > organ.max(axis=0) + 8.0) | (nodes < organ.min(axis=0) - 8.0)).any(axis=1)
    assert not found.fields[:, far].any() and found.fields[:, ~far].any()
    assert len(found.fields) == found.response.shape[1] and len(found.fields) % 3 == 0
    for j in (0, 1, 2):  # the first mode along each axis
        density = found.force_density(np.eye(len(found.fields))[j])
        others = [axis for axis in range(3) if axis != j]
        assert not density[:, others].any()
        near = density[~far, j]
        assert near.min() * near.max() > 0.0  # the smoothest one has one sign


def test_shapes_are_smooth_errors_of_a_contour_as_large_as_a_typical_discrepancy(
    solved: tuple[Linearisation, DataVector],
) -> None:
    at, data = solved
    found = ForceFields.around(at, data, NUMBERS)
    assert not found.shapes[data.n_modes :].any()
    if not data.n_modes:
        return
    points = at.scene.observation.points
    smooth = smooth_covariance(points, NUMBERS.force_typical_mm, NUMBERS.shape_length_mm)
    seen = data.modes.T @ smooth @ data.modes
    np.testing.assert_allclose(
        (found.shapes @ found.shapes.T)[: data.n_modes, : data.n_modes], seen, atol=0.05 * np.abs(seen).max()
    )


def test_forces_and_shapes_of_states_are_apart(solved: tuple[Linearisation, DataVector]) -> None:
    at, data = solved
    both = UnknownDiscrepancy.around(JointLinearisation((at, at)), [data, data], NUMBERS)
    one = both.each[0]
    n, k = one.response.shape
    assert both.response.shape == (2 * n, 2 * k)
    assert not both.response[:n, k:].any() and not both.response[n:, :k].any()
    np.testing.assert_array_equal(both.response[n:, k:], one.response)
    np.testing.assert_array_equal(both.free[:n, : 2 * k], both.response[:n])
    np.testing.assert_array_equal(both.free[:n, 2 * k : 2 * k + one.shapes.shape[1]], one.shapes)
