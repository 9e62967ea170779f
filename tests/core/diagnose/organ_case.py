"""A deformed state as diagnosis sees it, on arrays: an organ's surface, landmarks, matched motion in and around it, and a plain fit to
all of them whose residual and covariance are known."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import scipy.sparse as sp
from linear_case import BOUNDS, NUMBERS, fit_on_arrays

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.meshes import sphere_in_cube
from palpate.core.matched_motion import MatchedMotion
from palpate.core.observe.motion_data import MotionData
from palpate.core.observe.motion_observation import MotionObservation
from palpate.core.observe.motion_rows import MotionRows, mode_reader
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.joint_states import JointLinearisation, rows_of
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.residual.plain_fit import PlainFit

RADIUS = 10.0
NAMES = {1: "prostate_left", 2: "prostate_right"}
MESH = sphere_in_cube(4, 1, 2, RADIUS, 18.0)


def surface(count: int = 90) -> FloatArray:
    """Points (count, 3) mm evenly over the organ."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z**2)
    return RADIUS * np.column_stack([across * np.cos(turn), across * np.sin(turn), z])


@dataclass(eq=False)
class Bone:
    """Bones as the data vector counts them."""

    points: IntArray


def organ_case(
    *, drawn: bool = True, images: bool = True, marks: int = 2, bone: bool = True, seed: int = 5
) -> PlainFit:
    """The plain fit of one state."""
    rng = np.random.default_rng(seed)
    points = surface()
    motion = MotionObservation.empty()
    if images:
        at = rng.uniform(-17.0, 17.0, (40, 3))
        data = MotionData.of(MatchedMotion(at, 0.0 * at, np.tile(np.eye(3) / 0.04, (40, 1, 1)), 6.0))
        rows = MotionRows.of_points(data)
        motion = MotionObservation(rows, sp.csr_matrix((40, len(MESH.points))), mode_reader(rows))
    observation = SimpleNamespace(
        points=points,
        normals=points / RADIUS,
        region=np.where(points[:, 0] > 0.0, 1, 2),
        landmarks=np.zeros((marks, 6)),
        motion=motion,
        operator=sp.csr_matrix((len(points), len(MESH.points))),
        residual_and_normal=lambda u: (0.25 * points[:, 2] / RADIUS, points),
    )
    vector = DataVector.of(cast(Any, observation), cast(Any, Bone(np.zeros(0))) if bone else None, NUMBERS, drawn)
    half = rng.standard_normal((vector.n, vector.n)) / np.sqrt(vector.n)
    covariance = 0.09 * (half @ half.T + np.eye(vector.n))
    r, J = 0.4 * rng.standard_normal(vector.n), rng.standard_normal((vector.n, 2))
    problem = SimpleNamespace(regions=(1, 2), region_names=NAMES, organ_noise_mm=0.8)
    scene = SimpleNamespace(
        observation=observation,
        space=SimpleNamespace(mesh=MESH, nodes=MESH.points + 1.0),
        shift=np.ones_like(MESH.points),
        problem=problem,
        seen=lambda u: u + 1.0,
        parameters=SimpleNamespace(bounds=BOUNDS),
        composition=SimpleNamespace(observation=0.3),
    )
    theta, equilibrium = np.log([20.0, 60.0]), SimpleNamespace(u=np.zeros_like(MESH.points))
    plain = Linearisation(theta, np.zeros(0), cast(Any, scene), cast(Any, equilibrium), r, J, cast(Any, None))
    model: Any = SimpleNamespace(
        each=[SimpleNamespace(data=vector)],
        data_vectors=[vector],
        rows=rows_of([vector]),
        n=vector.n,
        surface=np.arange(vector.n_modes),
        bones=[slice(vector.n - 6, vector.n) if bone else None],
        correction=ElementCorrection.none(vector.n),
        first=SimpleNamespace(plain=SimpleNamespace(problem=problem), geometry=SimpleNamespace(walls=None)),
    )
    return fit_on_arrays(model, JointLinearisation((plain,)), covariance)
