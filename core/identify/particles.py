"""Evaluates many particles: each is one equilibrium and its misfit, in worker processes that hold the scene.

Every particle starts from the same reference equilibrium, so its value depends on itself alone, not on who computed it or when.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from palpate.core.fem.assembly import State
from palpate.core.fem.newton import NewtonOptions
from palpate.core.identify.coupled import CoupledScene, SceneOptions
from palpate.core.identify.misfit import Misfit, wall_response
from palpate.core.problem import IdentificationProblem

FloatArray = NDArray[np.float64]

_OPTIONS = NewtonOptions(rtol=1e-6, max_factorisations=60, stability=False)


@dataclass(frozen=True)
class ParticleValue:
    """Misfit of one particle (inf when it has no equilibrium), and why not; the Newton work it took."""

    value: float
    reason: str
    factorisations: int


class ParticleEvaluator:
    """A scene with its walls linearised at a reference, ready for any theta."""

    def __init__(self, problem_file: Path, reference_file: Path, element: str) -> None:
        self.scene = CoupledScene(IdentificationProblem.load(problem_file), SceneOptions(element=element))
        with np.load(reference_file, allow_pickle=False) as data:
            theta, u, p = data["theta"], data["u"], data["p"]
            self.scene.linearise(data["walls_u"])
        self.start = State(u, p)
        found = self.scene.solve(theta, self.start)
        self.misfit = Misfit.of(self.scene, wall_response(self.scene, found.u))

    def __call__(self, theta: FloatArray) -> ParticleValue:
        """Misfit at theta (t,)."""
        found = self.scene.solve(theta, self.start, _OPTIONS)
        if not found.converged:
            return ParticleValue(np.inf, found.reason, found.factorisations)
        return ParticleValue(self.misfit.value(found.u), "", found.factorisations)


_EVALUATOR: ParticleEvaluator | None = None


def initialise(problem_file: str, reference_file: str, element: str) -> None:
    """Run once in every worker process."""
    global _EVALUATOR
    threadpool_limits(1)  # one thread each: results do not depend on the number of workers, and processes scale better
    _EVALUATOR = ParticleEvaluator(Path(problem_file), Path(reference_file), element)


def evaluate(theta: FloatArray) -> ParticleValue:
    """Misfit at theta in a process that was initialised."""
    if _EVALUATOR is None:
        raise RuntimeError("particles.initialise was not run in this process")
    return _EVALUATOR(theta)
