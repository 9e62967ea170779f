"""Contact of a body's surface nodes with rigid surfaces, and friction: potentials and collision checks of the IPC
toolkit.

Li et al. 2020, Incremental potential contact (ACM Trans. Graph. 39:49), per area as in Li et al. 2023, Convergent
incremental potential contact. In a layer of thickness d0 before a wall the pressure at distance d = x d0 is

    p = -(stiffness / 4) d/dx [ -(x^2 - 1)^2 ln x^2 ],

nothing at the layer's edge, about the stiffness at half its thickness and without bound at the wall, so that a wall is
never crossed. Nodes meet the wall's faces; where the wall is flat or hollow, what lies between nodes on the body's
facets is then free of it too. A node's area is that of all its faces: pass only the faces that can meet the wall where
a body has edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.applications.dynamics.rigid import RigidSurface, depth
from palpate.applications.extra import of_the_extra
from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem.space import Space
from palpate.core.fem.terms.wall import wall_points

with of_the_extra():
    import ipctk

Entries = tuple[IntArray, IntArray, FloatArray]

# It warns of areas without the other set of collisions, see `_collisions`.
ipctk.set_logger_level(ipctk.LoggerLevel.error)
ipctk.set_num_threads(1)  # sums in another order would give another motion
_KEEP_AWAY = ipctk.AdditiveCCD()  # the toolkit's default takes seconds where edges are parallel


@dataclass(frozen=True)
class Layer:
    """thickness mm and stiffness kPa of the layer before a wall; half way into it the pressure is about the stiffness.

    friction : Coulomb's coefficient. sticking : mm/s, slower than this a contact counts as sticking and friction falls
    to zero.
    """

    thickness: float
    stiffness: float
    friction: float = 0.0
    sticking: float = 1.0

    def pressure(self, distance: FloatArray) -> FloatArray:
        """kPa at distances (mm) from a flat wall."""
        x = np.clip(np.asarray(distance, dtype=float) / self.thickness, 1e-300, 1.0)
        return 0.25 * self.stiffness * (4.0 * x * (x**2 - 1.0) * np.log(x**2) + 2.0 * (x**2 - 1.0) ** 2 / x)


class Contact:
    """The faces (f, 3) of a space's mesh against a rigid surface.

    Raises InputError where a node lies on or behind a face of it at the start, or the layer is not positive.
    """

    def __init__(self, space: Space, faces: IntArray, wall: RigidSurface, layer: Layer) -> None:
        if not (layer.thickness > 0.0 and layer.stiffness > 0.0 and layer.friction >= 0.0 and layer.sticking > 0.0):
            raise InputError(f"a contact layer needs positive thickness, stiffness and sticking speed; got {layer}")
        points = wall_points(space.face_nodes(faces), space.nodes)
        if not depth(wall, space.nodes[points.nodes[:, 0]]) < 0.0:
            raise InputError(
                "the body touches the rigid surface, or lies behind it, before it moves; start it further away"
            )
        self.layer, self.wall = layer, wall
        self.nodes: IntArray = points.nodes[:, 0]
        self._rest = np.asfortranarray(np.vstack([space.nodes[self.nodes], wall.points]))
        self._shape = (space.n_nodes, 3)
        n, still = len(self.nodes), len(wall.points)
        triangles = np.asarray(wall.faces + n, dtype=np.int32)
        self._mesh = ipctk.CollisionMesh(self._rest, ipctk.edges(triangles), triangles)
        self._mesh.can_collide = ipctk.make_static_obstacle_filter(n)
        # Points alone meet faces; a wall's own areas must not count, or its pressure would follow its triangles' sizes.
        self._mesh.vertex_areas = np.concatenate([points.measure, np.zeros(still)])
        self._mesh.edge_areas = np.zeros(self._mesh.num_edges)
        self._barrier = ipctk.BarrierPotential(layer.thickness, layer.stiffness, True)
        self._slip = ipctk.FrictionPotential(layer.sticking)
        low, high = wall.points.min(axis=0), wall.points.max(axis=0)
        self._low, self._high = low - layer.thickness, high + layer.thickness
        self._kept: tuple[FloatArray, ipctk.NormalCollisions] | None = None

    @property
    def friction(self) -> float:
        """Coulomb's coefficient."""
        return self.layer.friction

    def energy(self, u: FloatArray) -> float:
        """mN mm of the layer; u (n, 3) mm."""
        x = self._positions(u)
        return float(self._barrier(self._collisions(x), self._mesh, x))

    def gradient(self, u: FloatArray) -> FloatArray:
        """(n, 3) mN."""
        x = self._positions(u)
        return self._spread(self._barrier.gradient(self._collisions(x), self._mesh, x))

    def hessian(self, u: FloatArray) -> Entries:
        """Rows, columns and values (mN/mm) over displacement unknowns, positive semi-definite; no two nodes are
        coupled.
        """
        x = self._positions(u)
        H = self._barrier.hessian(self._collisions(x), self._mesh, x, ipctk.PSDProjectionMethod.CLAMP)
        return self._entries(H)

    def free_share(self, before: FloatArray, after: FloatArray) -> float:
        """Share, 0 to 1, of the way between two displacements (n, 3) that is free of collisions."""
        x0, x1 = self._positions(before), self._positions(after)
        n = len(self.nodes)
        ends = np.vstack([x0[:n], x1[:n]])
        if (ends.min(axis=0) > self._high).any() or (ends.max(axis=0) < self._low).any():
            return 1.0
        return float(ipctk.compute_collision_free_stepsize(self._mesh, x0, x1, narrow_phase_ccd=_KEEP_AWAY))

    def touching(self, u: FloatArray) -> bool:
        """Whether any node is within the layer."""
        return not self._collisions(self._positions(u)).empty()

    def friction_at(self, u: FloatArray) -> Friction:
        """Friction with the normal forces and directions of displacements u (n, 3)."""
        x = self._positions(u)
        held = ipctk.TangentialCollisions()
        held.build(self._mesh, x, self._collisions(x), self._barrier, self.layer.friction)
        return Friction(self, held, self._slip)

    def _positions(self, u: FloatArray) -> FloatArray:
        x = self._rest.copy(order="F")
        x[: len(self.nodes)] += u[self.nodes]
        return x

    def _collisions(self, x: FloatArray) -> ipctk.NormalCollisions:
        """Collisions at positions x. The last ones are cached: value, gradient and Hessian are evaluated at the
        same positions.
        """
        if self._kept is not None and np.array_equal(self._kept[0], x):
            return self._kept[1]
        collisions = ipctk.NormalCollisions()
        collisions.use_area_weighting = True
        # Every triangle near a node presses on it: twice along an edge between two, but smoothly. The sets that count a
        # node once jump there, and Newton does not converge.
        collisions.collision_set_type = ipctk.NormalCollisions.IPC
        collisions.build(self._mesh, x, self.layer.thickness)
        self._kept = (x, collisions)
        return collisions

    def _spread(self, g: FloatArray) -> FloatArray:
        out = np.zeros(self._shape)
        out[self.nodes] = g.reshape(-1, 3)[: len(self.nodes)]
        return out

    def _entries(self, H: object) -> Entries:
        entries = H.tocoo()  # type: ignore[attr-defined]
        of_body = 3 * len(self.nodes)
        kept = (entries.row < of_body) & (entries.col < of_body)
        row, column = entries.row[kept].astype(np.int64), entries.col[kept].astype(np.int64)
        return 3 * self.nodes[row // 3] + row % 3, 3 * self.nodes[column // 3] + column % 3, entries.data[kept]


@dataclass(frozen=True, eq=False)
class Friction:
    """Smoothed Coulomb friction with fixed normal forces, as a potential of velocities v (n, 3) mm/s."""

    contact: Contact
    held: ipctk.TangentialCollisions
    slip: ipctk.FrictionPotential

    def potential(self, v: FloatArray) -> float:
        """mN mm/s."""
        return float(self.slip(self.held, self.contact._mesh, self._velocities(v)))

    def gradient(self, v: FloatArray) -> FloatArray:
        """(n, 3) mN, against the slip."""
        return self.contact._spread(self.slip.gradient(self.held, self.contact._mesh, self._velocities(v)))

    def hessian(self, v: FloatArray) -> Entries:
        """Rows, columns and values (mN s/mm) over displacement unknowns, positive semi-definite."""
        H = self.slip.hessian(self.held, self.contact._mesh, self._velocities(v), ipctk.PSDProjectionMethod.CLAMP)
        return self.contact._entries(H)

    def _velocities(self, v: FloatArray) -> FloatArray:
        out = np.zeros_like(self.contact._rest)
        out[: len(self.contact.nodes)] = v[self.contact.nodes]
        return out
