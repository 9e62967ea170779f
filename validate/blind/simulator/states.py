"""The states that the scans show of a simulated body: one at rest and one deformed, or several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.simulate.inverse_map import BackwardMap
from palpate.simulate.wall_motion import WallMotion
from palpate.validate.blind.simulator.fem import Body, Laws
from palpate.validate.blind.simulator.newton import equilibrium, has_grown
from palpate.validate.blind.simulator.simulated_body import Simulated

# How far from bone the region's edge and the hollows' walls are drawn along with it.
_DRAWN_MM = 10.0
# No tissue gives up so much of its volume that this is left of a cell.
_FLAT = 0.1


@dataclass(frozen=True, eq=False)
class Shown:
    """One state: its hollows' and bones' motions from the stress-free body, and u (n, 3) mm of the nodes."""

    motions: Mapping[str, WallMotion]
    u: FloatArray


@dataclass(frozen=True, eq=False)
class Part:
    """A share of a motion."""

    motion: WallMotion
    share: float

    def displacement(self, points: FloatArray) -> FloatArray:
        """See `WallMotion.displacement`."""
        return self.share * self.motion.displacement(points)


@dataclass(frozen=True, eq=False)
class Sum:
    """Two motions of one wall from the stress-free body, together."""

    one: WallMotion
    other: WallMotion

    def displacement(self, points: FloatArray) -> FloatArray:
        """See `WallMotion.displacement`."""
        return self.one.displacement(points) + self.other.displacement(points)


@dataclass(frozen=True, eq=False)
class Along:
    """A wall's own motion and beside it the bone's, the more of it the nearer the bone: cells between them would fold without it.

    bones : tree of the bones' nodes at rest.
    """

    motion: WallMotion
    bone: WallMotion
    bones: cKDTree

    def displacement(self, points: FloatArray) -> FloatArray:
        """See `WallMotion.displacement`."""
        return self.motion.displacement(points) + _drawn(self.bones, points)[:, None] * self.bone.displacement(points)


def _drawn(bones: cKDTree, points: FloatArray) -> FloatArray:
    """Share (n,) of the bone's motion that points (n, 3) mm at rest have."""
    return np.asarray(np.exp(-0.5 * (bones.query(points)[0] / _DRAWN_MM) ** 2))


def shown(
    s: Simulated, boundary: Mapping[str, IntArray], walls: Mapping[str, WallMotion], near: FloatArray | None = None
) -> tuple[Shown, Shown]:
    """The states at rest and deformed. boundary : name -> faces (f, 3). near : (n, 3) mm, a deformed state like this one, if known.

    Raises ConvergenceError when one has no equilibrium.
    """
    still = Shown({}, np.zeros_like(s.body.nodes))
    rest = still
    if s.filled:
        before = {name: Part(walls[name], share) for name, share in s.filled.items() if name in walls}
        rest, near = _state(s, boundary, before, None, None), None
    motions = dict(walls)
    if s.filled:  # what the walls do between the scans comes on top of what they did before
        motions = {name: Part(walls[name], 1.0 + s.filled.get(name, 0.0)) for name in walls}
    return rest, _state(s, boundary, _with_bone(s, boundary, motions), s.load, near)


def shown_further(
    s: Simulated,
    boundary: Mapping[str, IntArray],
    rest: Shown,
    walls: Mapping[str, WallMotion],
    near: FloatArray | None = None,
) -> Shown:
    """Another deformed state of a body of which the scan at rest shows `rest`, its walls moved in their own way since then.

    near : (n, 3) mm, a deformed state like this one, if known. Raises ConvergenceError when it has no equilibrium.
    """
    before = rest.motions
    motions = {name: Sum(before[name], wall) if name in before else wall for name, wall in walls.items()}
    return _state(s, boundary, _with_bone(s, boundary, motions), s.load, near)


def _with_bone(
    s: Simulated, boundary: Mapping[str, IntArray], walls: Mapping[str, WallMotion]
) -> Mapping[str, WallMotion]:
    """The walls' motions, where the bones moved drawn along with them, and the bones'."""
    if s.bone is None or "bone" not in boundary:
        return walls
    bones = _tree(s.body, boundary["bone"])
    return {name: Along(wall, s.bone, bones) for name, wall in walls.items()} | {"bone": s.bone}


def _tree(body: Body, faces: IntArray) -> cKDTree:
    return cKDTree(body.nodes[np.unique(body.face_nodes(faces))])


def _state(
    s: Simulated,
    boundary: Mapping[str, IntArray],
    motions: Mapping[str, WallMotion],
    load: FloatArray | None,
    near: FloatArray | None,
) -> Shown:
    held = held_nodes(s.body, boundary, motions)
    u = equilibrium_near(near, s.body, s.laws(), held, load)
    ratio = np.linalg.det(s.body.gradients(u))
    if ratio.min() < _FLAT:
        raise ConvergenceError(f"the simulated tissue folds (volume ratio {ratio.min():.2f}); make the walls move less")
    return Shown(motions, u)


def equilibrium_near(
    near: FloatArray | None, body: Body, laws: Laws, held: FloatArray, load: FloatArray | None = None
) -> FloatArray:
    """Equilibrium from a state like it, or, where that leads nowhere, from rest: but not to what has grown, which gets less far so."""
    if near is not None:
        try:
            return equilibrium(body, laws, held, load, start=near)
        except ConvergenceError:
            if has_grown(laws):
                raise
    return equilibrium(body, laws, held, load)


def held_nodes(body: Body, boundary: Mapping[str, IntArray], motions: Mapping[str, WallMotion]) -> FloatArray:
    """(n, 3) mm where the boundary holds a node, NaN elsewhere; bone has the last word but for the region's edge."""
    held = np.full((len(body.nodes), 3), np.nan)
    for name in sorted(boundary, key=("rectum", "bladder", "bone", "outer").index):
        nodes = np.unique(body.face_nodes(boundary[name]))
        held[nodes] = motions[name].displacement(body.nodes[nodes]) if name in motions else 0.0
    if "bone" in motions and "bone" in boundary and "outer" in boundary:
        # The edge goes along where bone meets it: one that stayed would fold the cells between them.
        edge = np.unique(body.face_nodes(boundary["outer"]))
        along = _drawn(_tree(body, boundary["bone"]), body.nodes[edge])
        held[edge] = along[:, None] * motions["bone"].displacement(body.nodes[edge])
    return held


def backward(s: Simulated, boundary: Mapping[str, IntArray], state: Shown) -> BackwardMap:
    """Where each point of a state was in the stress-free body."""
    nodes = {name: np.unique(s.body.face_nodes(faces)) for name, faces in boundary.items()}
    return BackwardMap(s.body, state.u, nodes, dict(state.motions))
