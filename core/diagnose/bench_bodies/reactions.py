"""Force that a held or moved patch exerts on the body, and its derivative by the adjoint method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.sensitivity import parameter_force_everywhere
from palpate.core.fem.state import State
from palpate.core.forward.composition_scene import CompositionScene

_MN = 1000.0  # mN in a N
# Displacement of a difference that stands for a derivative, mm: far above rounding, far below what bends a curve.
_STEP_MM = 1e-4


@dataclass(frozen=True, eq=False)
class Reaction:
    """Component along `axis` of the force on the body at nodes (q,) that are held along it: observed, N, and its
    standard deviation."""

    nodes: IntArray
    axis: int
    observed: float
    sd: float

    def force(self, scene: CompositionScene, u: FloatArray) -> float:
        """The force, N, in the scene with its present materials at displacements u (n, 3) mm, pressures balanced.

        It is what the body's own forces and its loads leave over at the nodes (Eq 2 of Yang & Lin): in equilibrium that
        is the patch's.
        """
        assembler = scene.assembler
        left = assembler.residual(State(u, assembler.balanced_pressure(u)), 1.0).r_u
        return float(left.reshape(-1, 3)[self.nodes, self.axis].sum()) / _MN

    def change(self, scene: CompositionScene, u: FloatArray, move: FloatArray) -> float:
        """Its change, N, to first order, when u (n, 3) mm changes by move (n, 3) and the materials do not."""
        h = _STEP_MM / max(float(np.abs(move).max(initial=0.0)), 1e-30)
        return (self.force(scene, u + h * move) - self.force(scene, u - h * move)) / (2.0 * h)

    def in_theta(self, scene: CompositionScene, theta: FloatArray, equilibrium: Equilibrium) -> FloatArray:
        """Its derivative (t,), N, in theta (t,) at the scene's equilibrium, one back-substitution for all.

        With e the patch's unit motion, T the tangent and R the residual forces, dF/dtheta = (e + l)' dR/dtheta, where l
        over the free unknowns solves T l = -T e (Betti): the body's answer to the patch moving by itself.
        """
        tangent, assembler = equilibrium.tangent, scene.assembler
        tangent.set_materials()
        e = np.zeros((scene.space.n_nodes, 3))
        e[self.nodes, self.axis] = 1.0
        _, pulled = assembler.tangent(State(equilibrium.u, equilibrium.p), 1.0, e.ravel())
        answer = np.zeros(scene.space.n_displacements + scene.space.n_pressures)
        answer[: scene.space.n_displacements] = e.ravel()
        answer[assembler.kept] = -tangent.solve(pulled)
        return np.array([answer @ parameter_force_everywhere(tangent, d) for d in scene.directions(theta)]) / _MN
