"""How far walls without friction slide along themselves: two solutions of the plain model, compared."""

from __future__ import annotations

from dataclasses import replace

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.inference.starts import middle
from palpate.core.observe.wall_motion import WallMotion
from palpate.core.observe.wall_slip import WallSlip

# Stiffness along a wall without friction, over the tissue's shear modulus, 1/mm.
_FREE = 0.0


def let_slip(geometry: SharedGeometry) -> None:
    """Give the walls' motions their slip, at the middle of the stiffness' range; none where either has no equilibrium."""
    held = _moved(geometry)
    free = _moved(replace(geometry, walls=replace(geometry.walls, drag_per_mm=_FREE), motions=_free(geometry)))
    for name in geometry.motions:
        if name not in held or name not in free:
            continue
        points, normal, u = held[name]
        apart = free[name][2] - u
        along = apart - (apart * normal).sum(axis=1)[:, None] * normal
        geometry.motions[name] = replace(geometry.motions[name], slip=WallSlip(points, 0.5 * along))


def _free(geometry: SharedGeometry) -> dict[str, WallMotion]:
    """The same motions, which draw a wall nowhere."""
    out = {}
    for name, motion in geometry.motions.items():
        options = replace(motion.options, drag_per_mm=_FREE)
        out[name] = replace(motion, rigid=replace(motion.rigid, options=options))
    return out


def _moved(geometry: SharedGeometry) -> dict[str, tuple[FloatArray, FloatArray, FloatArray]]:
    """Of every wall its points at rest, normals and displacements, each (q, 3); empty without an equilibrium."""
    scene = CompositionScene(geometry, Composition(geometry.problem))
    found = scene.settle(middle(scene.parameters.bounds)).equilibrium
    if not found.converged:
        return {}
    return {
        name: (wall.rest, wall.normal, wall.points.displacements(found.u))
        for name, wall in zip(geometry.fields, scene.walls, strict=True)
    }
