"""Full solves for many parameters at once, in worker processes that hold the scene.

Every solve starts from the same reference equilibrium, so its outcome depends on its parameters alone, not on who computed it
or when.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions
from palpate.core.fem.state import State
from palpate.core.forward.make_scene import make_scene
from palpate.core.problem import IdentificationProblem

_QUICK = NewtonOptions(rtol=1e-6, max_factorisations=60, stability=False)


@dataclass(frozen=True, eq=False)
class Solved:
    """Displacements (q + k, 3) mm of surface points and landmarks, None with a reason where there is no equilibrium.

    sensitivities : (t, q + k, 3) mm per unit of theta where they were asked for.
    """

    displacement: FloatArray | None
    sensitivities: FloatArray | None
    reason: str
    factorisations: int


class ParticleSolver:
    """A scene with its walls linearised at a reference, ready for any theta."""

    def __init__(self, problem_file: Path, reference_file: Path, boundary: str, element: str, split_mu: bool) -> None:
        self.scene = make_scene(IdentificationProblem.load(problem_file), boundary, element, split_mu)
        with np.load(reference_file, allow_pickle=False) as data:
            self.start = State(data["u"], data["p"])
            self.scene.linearise(data["walls_u"])
        self._points = self.scene.observation.all_points

    def solve(self, theta: FloatArray, with_sensitivities: bool) -> Solved:
        """Equilibrium at theta (t,)."""
        found: Equilibrium = self.scene.solve(theta, self.start, replace(_QUICK, stability=with_sensitivities))
        if not found.converged:
            return Solved(None, None, found.reason, found.factorisations)
        slopes = None
        if with_sensitivities:
            slopes = np.stack([self._points @ s for s in self.scene.displacement_sensitivities(theta, found)])
        return Solved(self._points @ found.u, slopes, "", found.factorisations)


_SOLVER: ParticleSolver | None = None


def initialise(problem_file: str, reference_file: str, boundary: str, element: str, split_mu: bool) -> None:
    """Run once in every worker process."""
    global _SOLVER
    _SOLVER = ParticleSolver(Path(problem_file), Path(reference_file), boundary, element, split_mu)


def solve(theta: FloatArray) -> Solved:
    """Displacement at theta in a process that was initialised."""
    return _ready().solve(theta, False)


def solve_with_sensitivities(theta: FloatArray) -> Solved:
    """Displacement and its derivatives at theta in a process that was initialised."""
    return _ready().solve(theta, True)


def _ready() -> ParticleSolver:
    if _SOLVER is None:
        raise RuntimeError("particles.initialise was not run in this process")
    return _SOLVER
