"""Full solves for many parameters, in worker processes that hold the scene.

Every solve starts from the same reference equilibrium. Its result therefore depends on its parameters alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions
from palpate.core.fem.state import State
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.contact_force_scene import ContactForceScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.problem import IdentificationProblem
from palpate.core.residual.kept_fit import known_geometry
from palpate.core.residual.state_models import quick_geometry

_QUICK = NewtonOptions(rtol=1e-6, max_factorisations=60, stability=False)


@dataclass(frozen=True, eq=False)
class Solved:
    """Result of one full solve.

    displacement : (p, 3) mm of all observed points, None where there is no equilibrium. sensitivities :
    (t, p, 3) mm per unit of theta, None unless asked for. reason : why there is no equilibrium, "" otherwise.
    factorisations : work done.
    """

    displacement: FloatArray | None
    sensitivities: FloatArray | None
    reason: str
    factorisations: int


class ParticleSolver:
    """Scene of the quick element with its walls linearised at a reference equilibrium."""

    def __init__(
        self, problem_file: Path, reference_file: Path, fit_file: Path, state: int, boundary: str, split_mu: bool
    ) -> None:
        """fit_file : holds the geometry of deformed state `state`, see `known_geometry`."""
        known = known_geometry(fit_file, state)
        geometry = quick_geometry(IdentificationProblem.load(problem_file), split_mu=split_mu, known=known)
        self.scene = make_scene(geometry, boundary)
        with np.load(reference_file, allow_pickle=False) as data:
            self.start = State(data["u"], data["p"])
            self.scene.linearise(data["walls_u"])
        self._points = self.scene.observation.all_points

    def solve(self, theta: FloatArray, with_sensitivities: bool) -> Solved:
        """Full solve at theta (t,)."""
        equilibrium: Equilibrium = self.scene.solve(theta, self.start, replace(_QUICK, stability=with_sensitivities))
        if not equilibrium.converged:
            return Solved(None, None, equilibrium.reason, equilibrium.factorisations)
        slopes = None
        if with_sensitivities:
            slopes = np.stack([self._points @ s for s in self.scene.displacement_sensitivities(theta, equilibrium)])
        return Solved(self._points @ equilibrium.u, slopes, "", equilibrium.factorisations)


_SOLVER: ParticleSolver | None = None


def initialise(
    problem_file: str, reference_file: str, fit_file: str, state: int, boundary: str, split_mu: bool
) -> None:
    """Set-up of a worker process, called once in each."""
    global _SOLVER
    _SOLVER = ParticleSolver(Path(problem_file), Path(reference_file), Path(fit_file), state, boundary, split_mu)


def solve(theta: FloatArray) -> Solved:
    """Full solve at theta (t,). Raises RuntimeError in a process without `initialise`."""
    return _ready().solve(theta, False)


def solve_with_sensitivities(theta: FloatArray) -> Solved:
    """Full solve at theta (t,) with sensitivities. Raises RuntimeError in a process without `initialise`."""
    return _ready().solve(theta, True)


def _ready() -> ParticleSolver:
    if _SOLVER is None:
        raise RuntimeError("particles.initialise was not run in this process")
    return _SOLVER


def make_scene(geometry: SharedGeometry, boundary: str) -> CompositionScene:
    """boundary : "coupled" or "contact-force".

    Raises InputError or ConvergenceError as the scene's class does.
    """
    if boundary == "contact-force":
        return ContactForceScene(geometry)
    return CompositionScene(geometry, Composition(geometry.problem))
