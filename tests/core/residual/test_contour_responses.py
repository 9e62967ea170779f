"""What a wrongly drawn wall does to the data, to first order, against the better element solved with that wall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from synthetic_case import problem

from palpate.core.arrays import FloatArray
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.element_error import FineSolution, fine_element_model, fine_solution
from palpate.core.residual.fit_options import FitOptions
from palpate.core.residual.linearised_model import NOTHING, PLAIN, StateModel
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.state_models import joint_model

THETA = np.log([30.0, 70.0])
WALL, BUMP_MM, WIDTH_MM = "rectum", 0.1, 6.0


def state_model(posed: IdentificationProblem) -> StateModel:
    return joint_model([(posed, None)], NoiseModelOptions(), WallMotionOptions(), FitOptions()).first


def bump(x: FloatArray, centre: FloatArray) -> FloatArray:
    return np.asarray(BUMP_MM * np.exp(-0.5 * ((x - centre) ** 2).sum(axis=1) / WIDTH_MM**2))


def solved(model: StateModel) -> FineSolution:
    at = model.solve(PLAIN, THETA, NOTHING, None)
    assert at is not None
    found = fine_solution(fine_element_model(model), PLAIN, at)
    assert found is not None
    return found


def test_the_data_move_as_the_better_element_foretells() -> None:
    posed = problem(depth=5.0)
    model = state_model(posed)
    better = solved(model)
    seen = posed.walls[WALL].deformed
    # Over the organ, where the wall presses.
    centre = seen.points[np.argmin(np.linalg.norm(seen.points - posed.organ.rest.points.mean(axis=0), axis=1))]
    moved = replace(seen, points=seen.points + bump(seen.points, centre)[:, None] * seen.point_normals)
    other = state_model(replace(posed, walls={WALL: replace(posed.walls[WALL], deformed=moved)}))
    # The walls' motion along themselves stays: another part of the noise.
    other = replace(other, geometry=replace(other.geometry, motions=model.geometry.motions))
    change = solved(other).residual - better.residual

    responses = better.linearised(model.data, THETA, contours=True).responses
    assert responses is not None
    wall = better.scene.walls[0]
    told = responses.contours[WALL].response @ bump(wall.rest + wall.points.displacements(better.state.u), centre)
    assert np.linalg.norm(told - change) < 0.1 * np.linalg.norm(change)
    assert np.linalg.norm(change) > 0.1
