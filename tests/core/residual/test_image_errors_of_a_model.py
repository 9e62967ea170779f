"""Errors of the model that the images show, of a model that is solved: the region's edge, the alignment, what it cannot predict."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from quick_model import THETA, quick_model, solved_plain
from synthetic_case import problem

from palpate.core.fem.state import State
from palpate.core.matched_motion import MatchedMotion
from palpate.core.observe.contour_noise import noise_modes
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.image_errors import ImageErrors, _alignment, _edge, response_to_held
from palpate.core.residual.linearised_model import Linearisation, StateModel
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.surfaces.rigid_motion import rigid_motion

NUMBERS = NoiseModelOptions()
# Standard deviations of a registration of bones: mm along each axis, degrees about each.
FLOOR = np.array([0.2, 0.3, 0.4, 0.5, 0.6, 0.7])


@pytest.fixture(scope="module")
def posed() -> IdentificationProblem:
    """Two places in the block; its sides are an edge that is held."""
    places = np.array([[2.0, 3.0, 1.0], [-12.0, 8.0, 2.0]])
    precision = np.tile(np.eye(3) / 0.2**2, (2, 1, 1))
    plain = replace(problem(depth=3.0), matched=MatchedMotion(places, np.full((2, 3), 0.5), precision, 10.0))
    faces, _ = plain.mesh.boundary
    side = (np.abs(plain.mesh.points[faces][:, :, 0]) > 15.0 - 1e-6).all(axis=1)
    return replace(
        plain, boundary={**plain.boundary, "outer": faces[side]}, facts=replace(plain.facts, outer_fixed=True)
    )


@pytest.fixture(scope="module")
def model(posed: IdentificationProblem) -> StateModel:
    return quick_model(posed)


@pytest.fixture(scope="module")
def solved(model: StateModel) -> Linearisation:
    return solved_plain(model)


def test_what_a_held_face_does_is_the_slope_of_the_solved_model(solved: Linearisation) -> None:
    scene = solved.scene
    move = np.zeros((1, scene.space.n_nodes, 3))
    move[0, scene.held_nodes()] = [0.3, -0.2, 0.1]
    found = response_to_held(solved, move)[0]
    step = 0.02
    ends = []
    before = scene.prescribed
    for sign in (1.0, -1.0):
        scene.prescribed = before + sign * step * move[0].ravel()
        ends.append(scene.solve(THETA, State(solved.equilibrium.u, solved.equilibrium.p)).u)
    scene.prescribed = before
    np.testing.assert_allclose(found, (ends[0] - ends[1]) / (2.0 * step), atol=2e-3)
    np.testing.assert_allclose(found[scene.held_nodes()], np.tile([0.3, -0.2, 0.1], (len(scene.held_nodes()), 1)))


def test_what_the_model_cannot_predict_reaches_contours_and_images_alike(
    model: StateModel, solved: Linearisation
) -> None:
    options = NoiseModelOptions()
    errors = ImageErrors.of([solved], [model.data], options)
    local = errors.local[options.local_lengths_mm.index(10.0)]
    rows = model.data.motion
    # A point known to 0.2 mm along each axis: 1 mm of error is 5 of its standard deviations, in all its modes together.
    data = model.geometry.observation.motion.rows
    reader = model.geometry.observation.motion.reader
    near = np.exp(-0.5 * (np.linalg.norm(data.places[0] - data.places[1]) / 10.0) ** 2)
    share = np.where(data.place[:, None] == data.place, 1.0, near) * (data.as_a_whole @ data.as_a_whole.T)
    np.testing.assert_allclose(local[rows, rows], reader @ share @ reader.T, rtol=1e-9, atol=1e-9)
    assert np.abs(local[: model.data.n_modes, rows]).max() > 0.1
    places = model.geometry.observation.every_place
    every = np.exp(-0.5 * (np.linalg.norm(places[:, None] - places, axis=2) / 10.0) ** 2)
    seen = model.data.per_place(solved.scene, solved.equilibrium.u)
    whole = sum(seen[:, :, axis] @ every @ seen[:, :, axis].T for axis in range(3))
    np.testing.assert_allclose(local, whole, rtol=1e-9, atol=1e-9)
    assert np.linalg.eigvalsh(local).min() > -1e-9
    without = replace(model, data=replace(model.data, motion_covariance=np.zeros((0, 0))))
    unseen = ImageErrors.of([solved], [without.data], options)
    assert not np.any([unseen.edge, unseen.alignment, *unseen.local])


def test_the_edge_moves_smoothly_where_it_is_not_bone_and_its_motion_reaches_the_data(
    model: StateModel, solved: Linearisation
) -> None:
    """Its covariance is that of draws of the motion, each carried to the data by the model."""
    scene = solved.scene
    outer = np.unique(scene.space.face_nodes(scene.problem.boundary["outer"]))
    bone = scene.space.face_nodes(scene.problem.boundary["bone"])
    edge = np.setdiff1d(outer, bone)
    assert len(edge) < len(outer)
    modes = noise_modes(scene.space.nodes[edge], 1.0, NUMBERS.edge_length_mm, 0.9)
    covariance = np.zeros((model.data.n, model.data.n))
    for axis in range(3):
        moved = np.zeros((modes.shape[1], scene.space.n_nodes, 3))
        moved[:, edge, axis] = modes.T
        carried = model.data.response(scene, solved.equilibrium.u, response_to_held(solved, moved))
        covariance += carried @ carried.T
    found = _edge(solved, model.data, NUMBERS)
    np.testing.assert_allclose(found @ found.T, covariance, atol=1e-9)
    # 1 mm of the edge moves what is matched by a good part of it, in standard deviations of 0.2 mm.
    assert np.trace((found @ found.T)[model.data.motion, model.data.motion]) > 1.0
    np.testing.assert_allclose(ImageErrors.of([solved], [model.data], NUMBERS).edge, covariance, atol=1e-9)


@pytest.mark.parametrize("lacking", ["outer", "fixed", "images"])
def test_an_edge_that_is_free_or_nothing_that_shows_it_has_no_error(
    lacking: str, model: StateModel, solved: Linearisation
) -> None:
    plain, data = solved.scene.problem, model.data
    boundary = {k: v for k, v in plain.boundary.items() if lacking != "outer" or k != "outer"}
    facts = replace(plain.facts, outer_fixed=lacking != "fixed")
    scene: Any = SimpleNamespace(problem=replace(plain, boundary=boundary, facts=facts), space=solved.scene.space)
    if lacking == "images":
        data = replace(data, motion_covariance=np.zeros((0, 0)))
    assert _edge(replace(solved, scene=scene), data, NUMBERS).shape == (data.n, 0)


def test_a_wrong_alignment_moves_all_that_is_held_and_the_bones_see_it(
    model: StateModel, solved: Linearisation
) -> None:
    scene, bone = solved.scene, SimpleNamespace(floor_sd=FLOOR)
    data = replace(model.data, bone=bone)
    found = _alignment(solved, data)
    np.testing.assert_allclose(found[-6:], np.diag(FLOOR))
    held, nodes = scene.held_nodes(), scene.space.nodes
    pivot = scene.problem.organ.rest.points.mean(axis=0)
    for k in (1, 4):
        size = np.zeros(6)
        size[k] = FLOOR[k]
        moved = np.zeros((1, len(nodes), 3))
        moved[0, held] = rigid_motion(nodes[held], pivot, size)
        carried = model.data.response(scene, solved.equilibrium.u, response_to_held(solved, moved))[:, 0]
        np.testing.assert_allclose(found[:-6, k], carried, atol=1e-9)
        assert np.abs(carried).max() > 0.01
    assert _alignment(solved, model.data).shape == (model.data.n, 0)
    unseen = replace(data, motion_covariance=np.zeros((0, 0)))
    assert _alignment(solved, unseen).shape == (unseen.n, 0)
