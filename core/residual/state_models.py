"""Models of a case's deformed states, ready to be solved with the quick element."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest

import numpy as np

from palpate.core.forward.composition import Composition
from palpate.core.forward.contact_force_scene import ContactForceScene
from palpate.core.forward.known_geometry import KnownGeometry
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.forward.slipping_walls import let_slip
from palpate.core.observe.bone_registration import BoneRegistration
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import IdentificationProblem, StateData, SurfacePair
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.fit_options import QUICK, FitOptions
from palpate.core.residual.joint_states import JointModel
from palpate.core.residual.known_state import KnownState
from palpate.core.residual.linearised_model import SolveCount, StateModel
from palpate.core.residual.noise_model_options import NoiseModelOptions


def joint_model(
    pairs: Sequence[StateData],
    options: NoiseModelOptions,
    walls: WallMotionOptions,
    how: FitOptions,
    known: Sequence[KnownState] = (),
) -> JointModel:
    """Raises InputError for a problem that cannot be posed. pairs : of each deformed state the problem and the bones.

    known : of each state, where it was found before.
    """
    count, each = SolveCount(), []
    for k, ((problem, bones), found) in enumerate(zip_longest(pairs, known)):
        geometry = quick_geometry(problem, walls, how.split_mu, None if found is None else found.geometry)
        only = ContactForceScene(geometry) if how.boundary == "contact-force" else None
        observation = geometry.observation if only is None else only.observation
        if found is None:
            registration = _registration(problem, bones, options)
            data = DataVector.of(observation, registration, options, problem.organ_drawn)
        else:
            data = found.data(observation)
        none = ElementCorrection.none(data.n)
        each.append(StateModel(geometry, data, Composition(problem, state=k), none, only, count))
    return JointModel(tuple(each))


def quick_geometry(
    problem: IdentificationProblem,
    walls: WallMotionOptions | None = None,
    split_mu: bool = False,
    known: KnownGeometry | None = None,
) -> SharedGeometry:
    """Geometry for the quick element, walls with their slip. split_mu : see `StiffnessParameters`. known : of this
    problem, found before.
    """
    geometry = SharedGeometry.of(problem, QUICK, walls=walls, split_mu=split_mu, known=known)
    if known is None:
        let_slip(geometry)
    return geometry


def _registration(
    problem: IdentificationProblem, bones: SurfacePair | None, options: NoiseModelOptions
) -> BoneRegistration | None:
    if bones is None:
        return None
    floor = np.repeat([options.bone_floor_mm, options.bone_floor_deg], 3)
    return BoneRegistration.of(bones, problem.organ.rest.points.mean(axis=0), floor, options.bone_far_mm)
