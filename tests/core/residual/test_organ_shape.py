"""What an error of the organ's contour at rest does to the data, against the model solved on a moved mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_case
from scipy.spatial import cKDTree

from palpate.core.forward.composition import Composition
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.mesh import TetMesh
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.linearised_model import NOTHING, PLAIN, Linearisation, StateModel
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.organ_shape import ShapeModes, shape_response
from palpate.core.residual.state_models import joint_model

THETA = np.log([15.0, 80.0])
LENGTH_MM, LEAST, STEP_MM = 7.0, 0.05, 0.05


@pytest.fixture(scope="module")
def model() -> StateModel:
    problem = replace(synthetic_case.problem(), matched=synthetic_case.matched())
    return joint_model([(problem, None)], NoiseModelOptions(), WallMotionOptions(), FitOptions()).first


@pytest.fixture(scope="module")
def solved(model: StateModel) -> Linearisation:
    found = model.solve(PLAIN, THETA, NOTHING, None)
    assert found is not None
    return found


def _moved_mesh(model: StateModel, at: Linearisation, move: np.ndarray) -> Linearisation:
    """The model with the mesh's vertices moved, solved to the end."""
    problem = at.scene.problem
    mesh = TetMesh(problem.mesh.points + move, problem.mesh.cells, problem.mesh.regions)
    there = replace(problem, mesh=mesh)
    geometry = SharedGeometry.of(there, model.geometry.element, model.geometry)
    other = StateModel(geometry, model.data, Composition(there), ElementCorrection.none(model.data.n))
    found = other.solve(PLAIN, THETA, NOTHING, at)
    assert found is not None
    return found


@pytest.mark.parametrize("mode", [0, 3])
def test_the_data_change_as_on_a_mesh_that_was_moved(model: StateModel, solved: Linearisation, mode: int) -> None:
    modes = ShapeModes.of(solved.scene, LENGTH_MM, LEAST)
    response = shape_response(solved.scene, model.data, solved.tangent, LENGTH_MM, LEAST)
    step = STEP_MM / np.abs(modes.vectors[:, mode]).max()
    outside, inside = (_moved_mesh(model, solved, sign * step * modes.moves[mode]) for sign in (1.0, -1.0))
    found = response @ modes.vectors[:, mode]
    motion = model.data.motion
    expected = (outside.residual - inside.residual)[motion] / (2.0 * step)
    assert np.linalg.norm(expected) > 0.0
    assert np.linalg.norm(found[motion] - expected) < 0.05 * np.linalg.norm(expected)
    # The organ's points go with the mesh; what counts is how far they come to lie from the deformed contour.
    observation, surface = solved.scene.observation, slice(0, model.data.n_modes)
    distances = [observation.residual(at.equilibrium.u) for at in (outside, inside)]
    expected = model.data.modes.T @ (distances[0] - distances[1]) / (2.0 * step)
    assert np.linalg.norm(expected) > 0.0
    assert np.linalg.norm(found[surface] - expected) < 0.05 * np.linalg.norm(expected)


def test_on_the_surface_a_vertex_moves_along_the_normal_by_the_mode_itself(solved: Linearisation) -> None:
    """Nystroem's extension: with the kernel that the modes are of, it is the mode where the mode is known."""
    modes, observation = ShapeModes.of(solved.scene, LENGTH_MM, LEAST), solved.scene.observation
    X = solved.scene.problem.mesh.points
    apart, nearest = cKDTree(observation.points).query(X)
    on_it = (apart < 1.5) & modes.moves[0].any(axis=1)
    assert on_it.sum() > 20
    along = np.einsum("vi,vi->v", modes.moves[0, on_it], observation.normals[nearest[on_it]])
    there = modes.vectors[nearest[on_it], 0]
    assert np.sum(along * there) / np.sum(there**2) == pytest.approx(1.0, abs=0.1)


def test_the_boundary_of_the_region_stays(solved: Linearisation) -> None:
    moves = ShapeModes.of(solved.scene, LENGTH_MM, LEAST).moves
    assert not moves[:, np.unique(solved.scene.problem.mesh.boundary[0])].any()
    assert moves.any()


def test_a_shape_that_is_not_known_adds_to_the_covariance_of_the_motion(
    model: StateModel, solved: Linearisation
) -> None:
    options = NoiseModelOptions()
    shape = shape_response(solved.scene, model.data, solved.tangent, LENGTH_MM, LEAST)
    none, sizes = np.zeros((model.data.n, 0)), NoiseSizes.of(options)
    known, unknown = (
        NoiseParts.of([solved], [model.data], options, None, shapes).covariance(sizes, none)
        for shapes in (None, [shape])
    )
    more = (unknown - known)[model.data.motion, model.data.motion]
    assert np.linalg.eigvalsh(more).min() > -1e-9
    assert np.trace(more) > 0.0
