"""The `coupled` boundary: organ and tissue in one system, driven by the walls; the organ's surface is predicted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.sensitivity import direct
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.forward.scene_parts import distance_fields, driving_walls, wall_of
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


@dataclass(frozen=True)
class SceneOptions:
    """Discretisation and parameters of a problem.

    element : see core.fem.elements. solver : "auto", "pardiso" or "superlu". split_mu : see `StiffnessParameters`.
    """

    element: str = "p2p1"
    solver: str = "auto"
    split_mu: bool = False


class CoupledScene:
    """One identification problem, ready to be solved for any stiffness.

    Raises InputError when the problem has nothing that deforms the organ or nothing that holds it.
    """

    def __init__(self, problem: IdentificationProblem, options: SceneOptions | None = None) -> None:
        options = options or SceneOptions()
        self.problem = problem
        self.parameters = StiffnessParameters(problem.regions, problem.facts, options.split_mu)
        self.space = Space.of(problem.mesh, options.element)
        self.walls = [
            wall_of(distance_fields(pair), problem, name, self.space, self.space.nodes)
            for name, pair in driving_walls(problem).items()
        ]
        if not self.walls:
            raise InputError("the case shows neither bladder nor rectum in both scans: nothing drives the organ")
        free = np.ones((self.space.n_nodes, 3), dtype=bool)
        free[self.held_nodes()] = False
        if free.all():
            raise InputError("the case has no bone and no fixed outer surface: nothing holds the organ in place")
        self.assembler = Assembler(self.space, free.ravel(), self.walls, options.solver)
        self.observation = SurfaceObservation.of(problem, self.space)
        self.linearised_at = np.zeros((self.space.n_nodes, 3))

    def solve(
        self, theta: FloatArray, start: State | FloatArray | None = None, options: NewtonOptions | None = None
    ) -> Equilibrium:
        """Equilibrium at parameters theta."""
        return solve_equilibrium(self.assembler, self.parameters.materials(theta), start=start, options=options)

    def settle(self, theta: FloatArray, start: State | Equilibrium | None = None, rounds: int = 8) -> Settled:
        """Settle the walls on the deformed surfaces for parameters theta: solve, linearise the walls anew, repeat.

        Afterwards `solve` uses the walls' last linearisation: for other theta they slide by a tenth of a millimetre at
        most, which moves them off the surface by a thousandth.
        """
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

    def linearise(self, u: FloatArray, way: float = 1.0) -> None:
        """Linearise the walls at nodal displacements u (n, 3) mm. way : see `SlidingWall.linearised_at`."""
        self.linearised_at = u
        self.walls = [w.linearised(u, way) for w in self.walls]
        self.assembler.terms = tuple(self.walls)

    def _wall_motion(self, change: FloatArray) -> float:
        parts = [w.points.displacements(change) for w in self.walls]
        return float(np.sqrt((np.vstack(parts) ** 2).sum(axis=1).mean()))

    def displacement_sensitivities(self, theta: FloatArray, equilibrium: Equilibrium) -> FloatArray:
        """du/dtheta (t, n, 3) mm at the equilibrium of theta (t,), solved with its stability check."""
        return direct(equilibrium.tangent, self.parameters.directions(theta))

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
