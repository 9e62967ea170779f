"""The plain model's scene for the boundary a person chose."""

from __future__ import annotations

from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.contact_force_scene import ContactForceScene
from palpate.core.forward.shared_geometry import SharedGeometry


def make_scene(geometry: SharedGeometry, boundary: str) -> CompositionScene:
    """boundary : "coupled" or "contact-force".

    Raises InputError or ConvergenceError as the scene's class does.
    """
    if boundary == "contact-force":
        return ContactForceScene(geometry)
    return CompositionScene(geometry, Composition(geometry.problem))
