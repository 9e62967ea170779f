"""The scene of a problem for the boundary a person chose."""

from __future__ import annotations

from typing import TypeAlias

from palpate.core.forward.contact_force_scene import ContactForceScene
from palpate.core.forward.coupled_scene import CoupledScene, SceneOptions
from palpate.core.problem import IdentificationProblem

Scene: TypeAlias = CoupledScene | ContactForceScene


def make_scene(problem: IdentificationProblem, boundary: str, element: str, split_mu: bool = False) -> Scene:
    """boundary : "coupled" or "contact-force". split_mu : see `StiffnessParameters`.

    Raises InputError or ConvergenceError as the scene's class does.
    """
    options = SceneOptions(element=element, split_mu=split_mu)
    return ContactForceScene(problem, options) if boundary == "contact-force" else CoupledScene(problem, options)
