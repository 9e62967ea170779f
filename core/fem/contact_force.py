"""The contact-force boundary: Eq 9 of Yang & Lin, MaterialCloning.

Step 1: the equilibrium of the tissue alone, with the observed displacement u_s prescribed on the organ's surface. Step
2: the reaction f = K u_s of the tissue, with its sign reversed, as a dead load on the organ alone.

A dead load leaves the organ's rigid motion undetermined, and a compressive one turns the organ over. Hence a hold: the
mean displacement and rotation of a dozen surface points equal those of u_s. Limits: noise in u_s enters f undamped, and
a soft organ can still be unstable, which the inertia of the tangent shows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.loads import nodal_force
from palpate.core.fem.terms.wall import SlidingWall

# Number of points whose mean motion is held; stiffness of that hold relative to a typical shear modulus times the
# organ's size.
_HELD_POINTS = 12
_HOLD = 100.0


@dataclass(frozen=True, eq=False)
class InterfaceMotion:
    """Displacement u (k, 3) mm of nodes (k,) that organ and tissue share, as node indices of some space."""

    nodes: IntArray
    u: FloatArray


def tissue_reaction(
    tissue: Space,
    material: Mapping[int, Material],
    motion: InterfaceMotion,
    held: IntArray,
    walls: Sequence[SlidingWall] = (),
    rounds: int = 6,
) -> FloatArray:
    """Force (k, 3) mN of the deformed tissue on the organ at the shared nodes: -f of Eq 9.

    held : nodes of the tissue that do not move (bone, outer surface). walls : of hollow organs, brought to where they
    were seen within `rounds` linearisations. Raises ConvergenceError when the tissue has no equilibrium.
    """
    free = np.ones((tissue.n_nodes, 3), dtype=bool)
    free[motion.nodes] = False
    free[held] = False
    goal = np.zeros((tissue.n_nodes, 3))
    goal[motion.nodes] = motion.u
    assembler = Assembler(tissue, free.ravel(), walls)
    u = np.zeros((tissue.n_nodes, 3))
    for k in range(rounds if walls else 1):
        assembler.terms = tuple(w.linearised(u, min(1.0, (k + 1) / 3.0)) for w in walls)
        equilibrium = solve_equilibrium(assembler, material, goal.ravel())
        if not equilibrium.converged:
            raise ConvergenceError(f"the tissue alone cannot follow the organ's surface: {equilibrium.reason}")
        u = equilibrium.u
    reaction = assembler.residual(State(equilibrium.u, equilibrium.p), 1.0).r_u.reshape(-1, 3)
    return -reaction[motion.nodes]


@dataclass(frozen=True, eq=False)
class RigidHold:
    """Energy 1/2 stiffness |c|^2, c the six differences of mean displacement and rotation of some nodes from wanted
    ones.

    nodes : (k,). rows : (6, 3 k) orthonormal rigid motions of these nodes. target : (3 k,) mm, whose rigid part is
    wanted. stiffness : mN/mm.
    """

    nodes: IntArray
    rows: FloatArray
    target: FloatArray
    stiffness: float

    @classmethod
    def at(cls, positions: FloatArray, nodes: IntArray, target: FloatArray, stiffness: float) -> RigidHold:
        """Hold nodes (k,) at positions (k, 3) to the rigid part of target (k, 3)."""
        x = positions - positions.mean(axis=0)
        modes = [np.tile(e, (len(x), 1)) for e in np.eye(3)] + [np.cross(e, x) for e in np.eye(3)]
        basis = np.linalg.qr(np.stack([m.ravel() for m in modes], axis=1))[0]
        return cls(nodes, basis.T, target.ravel(), stiffness)

    @property
    def unknowns(self) -> IntArray:
        """See `Term.unknowns`."""
        return (3 * self.nodes[:, None] + np.arange(3)).reshape(1, -1)

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """See `Term.evaluate`."""
        c = self.rows @ (u[self.nodes].ravel() - load * self.target)
        gradient = (self.stiffness * self.rows.T @ c)[None]
        k = gradient.shape[1]
        tangent = self.stiffness * (self.rows.T @ self.rows)[None] if order >= 2 else np.zeros((0, k, k))
        return 0.5 * self.stiffness * float(c @ c), gradient, tangent


def organ_terms(organ: Space, motion: InterfaceMotion, force: FloatArray, modulus: float) -> list[Term]:
    """Load and rigid hold of the organ alone.

    motion : with node indices of the organ. force : (k, 3) mN at the motion's nodes. modulus : a typical shear modulus,
    kPa.
    """
    x = organ.nodes[motion.nodes]
    chosen = _spread(x, _HELD_POINTS)
    stiffness = _HOLD * modulus * float(np.ptp(x, axis=0).mean())
    hold = RigidHold.at(x[chosen], motion.nodes[chosen], motion.u[chosen], stiffness)
    return [nodal_force(motion.nodes, force), hold]


def _spread(x: FloatArray, n: int) -> IntArray:
    """n of the points (k, 3) far from each other, the first the farthest from their centre."""
    chosen = [int(np.argmax(np.linalg.norm(x - x.mean(axis=0), axis=1)))]
    nearest = np.linalg.norm(x - x[chosen[0]], axis=1)
    while len(chosen) < min(n, len(x)):
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(x - x[chosen[-1]], axis=1))
    return np.array(chosen)
