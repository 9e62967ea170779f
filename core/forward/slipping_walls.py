"""How far walls without friction slide along themselves, and what motions the images are read for: two solutions of the
plain model, compared."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.inference.starts import middle
from palpate.core.observe.wall_motion import WallMotion
from palpate.core.observe.wall_slip import WallSlip

# Stiffness along a wall without friction, over the tissue's shear modulus, 1/mm.
_FREE = 0.0


def let_slip(geometry: SharedGeometry) -> None:
    """Give the walls' motions their slip, at the middle of the stiffness' range; none where either has no equilibrium.

    The images are read for what the slip and the stiffness move, so that none of what they show of either is lost.
    """
    held = _solved(geometry)
    free = _solved(replace(geometry, walls=replace(geometry.walls, drag_per_mm=_FREE), motions=_free(geometry)))
    if held is None:
        return
    motions = held.scene.displacement_sensitivities(held.theta, held.equilibrium)
    if free is not None:
        motions = np.concatenate([motions, (free.equilibrium.u - held.equilibrium.u)[None]])
        for name, slip in _slips(held, free).items():
            geometry.motions[name] = replace(geometry.motions[name], slip=slip)
    geometry.observation = replace(geometry.observation, motion=geometry.observation.motion.showing(motions))


@dataclass(frozen=True, eq=False)
class _Solved:
    """A scene in equilibrium at theta (t,)."""

    scene: CompositionScene
    theta: FloatArray
    equilibrium: Equilibrium


def _free(geometry: SharedGeometry) -> dict[str, WallMotion]:
    """The same motions, which draw a wall nowhere."""
    out = {}
    for name, motion in geometry.motions.items():
        options = replace(motion.options, drag_per_mm=_FREE)
        out[name] = replace(motion, rigid=replace(motion.rigid, options=options))
    return out


def _solved(geometry: SharedGeometry) -> _Solved | None:
    scene = CompositionScene(geometry, Composition(geometry.problem))
    theta = middle(scene.parameters.bounds)
    equilibrium = scene.settle(theta).equilibrium
    return _Solved(scene, theta, equilibrium) if equilibrium.converged else None


def _slips(held: _Solved, free: _Solved) -> dict[str, WallSlip]:
    """Half of what every wall slides along itself where it is free."""
    out = {}
    for name, wall, other in zip(held.scene.geometry.fields, held.scene.walls, free.scene.walls, strict=True):
        apart = other.points.displacements(free.equilibrium.u) - wall.points.displacements(held.equilibrium.u)
        along = apart - (apart * wall.normal).sum(axis=1)[:, None] * wall.normal
        out[name] = WallSlip(wall.rest, 0.5 * along)
    return out
