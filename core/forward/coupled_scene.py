"""The `coupled` boundary: organ and tissue in one system, driven by the walls; the organ's surface is predicted."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.problem import IdentificationProblem

# Walls have settled when a round moves them by less than this (rms), mm.
SETTLED_MM = 0.01


# Solves while the walls settle: their linearisation changes by more than this tolerance.
_ON_THE_WAY = NewtonOptions(rtol=1e-5, stability=False)


@dataclass(frozen=True, eq=False)
class Settled:
    """Outcome of `CoupledScene.settle`.

    equilibrium : the last one. last_motion_mm : of the walls in the last round, rms. rounds : their number.
    """

    equilibrium: Equilibrium
    last_motion_mm: float
    rounds: int


class CoupledScene:
    """Organ and tissue in one system, solved for any stiffness; `CompositionScene` builds it.

    walls : of the hollow organs, held on the deformed scan's surfaces. linearised_at : (n, 3) mm, where.
    """

    problem: IdentificationProblem
    parameters: StiffnessParameters
    space: Space
    walls: list[SlidingWall]
    assembler: Assembler
    observation: SurfaceObservation
    linearised_at: FloatArray

    @abstractmethod
    def solve(
        self, theta: FloatArray, start: State | FloatArray | None = None, options: NewtonOptions | None = None
    ) -> Equilibrium:
        """Equilibrium at parameters theta (t,)."""

    def settle(self, theta: FloatArray, start: State | Equilibrium | None = None, rounds: int = 8) -> Settled:
        """Settle the walls on the deformed surfaces for parameters theta: solve, linearise the walls anew, repeat.

        Afterwards `solve` uses the walls' last linearisation: for other theta they slide by a tenth of a millimetre at
        most, which moves them off the surface by a thousandth. Without walls one solve is all.
        """
        if not self.walls:
            return Settled(self.solve(theta, None if start is None else _state(start)), 0.0, 1)
        equilibrium = self._approach(theta) if start is None else None
        if equilibrium is not None and not equilibrium.converged:
            return Settled(equilibrium, np.inf, 0)
        state = _state(start if equilibrium is None else equilibrium)
        moved, pace, k = np.inf, 1.0, 0
        target = state.u
        while k < rounds and moved >= SETTLED_MM:
            k += 1
            self.linearise(target)
            equilibrium = self.solve(theta, state, _ON_THE_WAY)
            if not equilibrium.converged:
                return Settled(equilibrium, moved, k)
            before, moved = moved, self._wall_motion(equilibrium.u - target)
            if moved > 0.8 * before:
                pace = max(0.5 * pace, 0.2)  # the walls oscillate: under-relax
            target = target + pace * (equilibrium.u - target)
            state = _state(equilibrium)
        return Settled(self.solve(theta, state), moved, k)

    def _approach(self, theta: FloatArray, stages: int = 4) -> Equilibrium:
        """Move the walls onto their surfaces in equal stages, each with its own normals."""
        state: State | None = None
        for k in range(stages):
            self.linearise(np.zeros((self.space.n_nodes, 3)) if state is None else state.u, 1.0 / (stages - k))
            equilibrium = self.solve(theta, state, _ON_THE_WAY)
            if not equilibrium.converged:
                break
            state = _state(equilibrium)
        return equilibrium

    @abstractmethod
    def linearise(self, u: FloatArray, way: float = 1.0) -> None:
        """Linearise the walls at nodal displacements u (n, 3) mm. way : see `SlidingWall.linearised_at`."""

    def _wall_motion(self, change: FloatArray) -> float:
        parts = [w.points.displacements(change) for w in self.walls]
        return float(np.sqrt((np.vstack(parts) ** 2).sum(axis=1).mean()))

    def held_nodes(self) -> IntArray:
        """Nodes that do not move: those of bone, and of the outer surface where the case fixes it."""
        names = ("bone", "outer") if self.problem.facts.outer_fixed else ("bone",)
        faces = [self.problem.boundary[n] for n in names if n in self.problem.boundary]
        if not faces:
            return np.zeros(0, dtype=np.int64)
        return np.unique(self.space.face_nodes(np.vstack(faces)))


def _state(solution: State | Equilibrium | None) -> State:
    assert solution is not None
    return solution if isinstance(solution, State) else State(solution.u, solution.p)
