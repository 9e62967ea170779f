"""Tissue that slides along a wall whose new shape is known, without friction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.space import Space
from palpate.core.fem.terms.wall import SlidingWall, wall_points
from palpate.core.surfaces.distance_field import SignedDistanceField
from palpate.simulate.wall_motion import MovedWall

# Stiffness of the constraint over the tissue's shear modulus, 1/mm: gaps stay below 0.01 mm.
_STIFFNESS = 200.0


@dataclass(frozen=True, eq=False)
class Glide:
    """The constraint that the nodes of a wall stay on its moved shape."""

    term: SlidingWall

    @classmethod
    def of(cls, space: Space, face_nodes: IntArray, wall: MovedWall, u: FloatArray, shear_modulus: float) -> Glide:
        """For the faces (f, 3 or 6 nodes) of a wall that stands where its motion puts it, u (n, 3) mm."""
        surface, motion = wall.surface, wall.motion
        moved = surface.points + motion.displacement(surface.points)
        field = SignedDistanceField.from_surface(moved, surface.faces)
        points = wall_points(face_nodes, space.nodes)
        rest = points.positions(space.nodes)
        offset, gradient = field.value_and_gradient(rest + points.displacements(u))
        term = SlidingWall(
            points, rest, field.value_and_gradient, offset, gradient, np.zeros(len(rest)), _STIFFNESS * shear_modulus
        )
        return cls(term.linearised(u))

    def linearised(self, u: FloatArray) -> SlidingWall:
        """The constraint at displacements u (n, 3) mm of all nodes, as a term."""
        return self.term.linearised(u)

    def sliding(self, change: FloatArray) -> float:
        """How far (rms mm) a change of displacement (n, 3) moves the wall."""
        return float(np.sqrt((self.term.points.displacements(change) ** 2).sum(axis=1).mean()))

    @property
    def unknowns(self) -> IntArray:
        """See `Term.unknowns`."""
        return self.term.unknowns

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """See `Term.evaluate`."""
        return self.term.evaluate(u, load, order)
