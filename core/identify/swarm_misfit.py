"""Misfit of many particles: from the reduced model where its error estimate is small enough, else from a full solve."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.identify import particle_solves
from palpate.core.identify.misfit import Misfit
from palpate.core.identify.particle_solves import Solved
from palpate.core.reduced.greedy_design import ReducedOptions, Snapshot
from palpate.core.reduced.reduced_model import ReducedModel
from palpate.core.worker.progress import Progress

# Largest estimated error of a reduced displacement that the swarm uses, mm: a twentieth of the contour noise (0.4 mm).
TRUSTED_MM = 0.02
_REDUCED = ReducedOptions(tolerance=1e-3, max_snapshots=80)


@dataclass
class Evaluator:
    """Evaluation of the swarm's particles, with a count of the work.

    misfit : of the data. executor : processes in which `particle_solves.initialise` was called. reduced : None to solve
    every particle in full. reasons : of the failed solves.
    """

    misfit: Misfit
    executor: Executor
    reduced: ReducedModel | None = None
    full_solves: int = 0
    reduced_evaluations: int = 0
    factorisations: int = 0
    failed: int = 0
    reasons: list[str] = field(default_factory=list)

    def values(self, thetas: FloatArray) -> FloatArray:
        """Misfit (m,) at thetas (m, t); infinite where there is no equilibrium."""
        out = np.full(len(thetas), np.inf)
        in_full = np.ones(len(thetas), dtype=bool)
        if self.reduced is not None:
            in_full = self.reduced.error_estimate(thetas) > TRUSTED_MM
            trusted = np.flatnonzero(~in_full)
            self.reduced_evaluations += len(trusted)
            for k, v in zip(trusted, self.reduced.evaluate(thetas[trusted]) if len(trusted) else [], strict=True):
                out[k] = self._misfit(v)
        rows = np.flatnonzero(in_full)
        for k, solved in zip(rows, self.executor.map(particle_solves.solve, list(thetas[rows])), strict=True):
            self._count(solved)
            if solved.displacement is not None:
                out[k] = self._misfit(solved.displacement)
        return out

    def build_reduced(self, bounds: FloatArray, scene: str, path: Path, progress: Progress) -> None:
        """Set the reduced model of this scene (a hash): loaded from `path`, or built from full solves and stored there.

        Raises ConvergenceError when most first solves fail, InputError when the file cannot be written.
        """
        self.reduced = ReducedModel.load(path, scene)
        if self.reduced is None:
            self.reduced = ReducedModel.build(self._snapshots, bounds, scene, _REDUCED, progress)
            self.reduced.save(path)

    def _snapshots(self, thetas: FloatArray) -> list[Snapshot | None]:
        out: list[Snapshot | None] = []
        for solved in self.executor.map(particle_solves.solve_with_sensitivities, list(thetas)):
            self._count(solved)
            out.append(None if solved.displacement is None else Snapshot(solved.displacement, solved.sensitivities))
        return out

    def _count(self, solved: Solved) -> None:
        self.full_solves += 1
        self.factorisations += solved.factorisations
        if solved.displacement is None:
            self.failed += 1
            self.reasons.append(solved.reason)

    def _misfit(self, v: FloatArray) -> float:
        return float((self.misfit.residual_of(v) ** 2).sum())
