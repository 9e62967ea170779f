"""Misfit of many particles: from reduced models where their error estimates are small enough, else from full solves."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.identify import particle_solves
from palpate.core.identify.misfit import Misfit
from palpate.core.identify.particle_solves import Solved
from palpate.core.reduced.greedy_design import ReducedOptions, Snapshot
from palpate.core.reduced.reduced_model import ReducedModel
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.worker.progress import Progress

# Largest estimated error of a reduced displacement that the swarm uses, mm: a twentieth of the contour noise (0.4 mm).
TRUSTED_MM = 0.02
# Of the largest displacement: the reduced model is no better than the swarm trusts.
_REDUCED = ReducedOptions(tolerance=1e-3, max_snapshots=80)


@dataclass(eq=False)
class StateEvaluator:
    """Displacements of the observed points of one deformed state, with a count of the work.

    executor : processes in which `particle_solves.initialise` was called. reduced : None to solve every particle in
    full.
    """

    executor: Executor
    reduced: ReducedModel | None = None
    full_solves: int = 0
    reduced_evaluations: int = 0
    factorisations: int = 0
    failed: int = 0

    def displacements(self, thetas: FloatArray) -> list[FloatArray | None]:
        """(p, 3) mm for each of thetas (m, t); None where there is no equilibrium."""
        out: list[FloatArray | None] = [None] * len(thetas)
        in_full = self._untrusted(thetas)
        if self.reduced is not None and not in_full.all():
            trusted = np.flatnonzero(~in_full)
            self.reduced_evaluations += len(trusted)
            for k, v in zip(trusted, self.reduced.evaluate(thetas[trusted]), strict=True):
                out[k] = v
        rows = np.flatnonzero(in_full)
        for k, solved in zip(rows, self.executor.map(particle_solves.solve, list(thetas[rows])), strict=True):
            self._count(solved)
            out[k] = solved.displacement
        return out

    def build_reduced(self, bounds: FloatArray, scene: str, path: Path, progress: Progress) -> None:
        """Set the reduced model of this scene (a hash): loaded from `path`, or built from full solves and stored there.

        Raises ConvergenceError when most first solves fail, InputError when the file cannot be written.
        """
        self.reduced = ReducedModel.load(path, scene)
        if self.reduced is None:
            self.reduced = ReducedModel.build(self._snapshots, bounds, scene, _REDUCED, progress)
            self.reduced.save(path)

    def _untrusted(self, thetas: FloatArray) -> BoolArray:
        if self.reduced is None:
            return np.ones(len(thetas), dtype=bool)
        return np.asarray(self.reduced.error_estimate(thetas) > TRUSTED_MM)

    def _snapshots(self, thetas: FloatArray) -> list[Snapshot | None]:
        out: list[Snapshot | None] = []
        for solved in self.executor.map(particle_solves.solve_with_sensitivities, list(thetas)):
            self._count(solved)
            out.append(None if solved.displacement is None else Snapshot(solved.displacement, solved.sensitivities))
        return out

    def _count(self, solved: Solved) -> None:
        self.full_solves += 1
        self.factorisations += solved.factorisations
        self.failed += int(solved.displacement is None)


def values(
    misfit: Misfit, states: list[StateEvaluator], correction: ElementCorrection, thetas: FloatArray
) -> FloatArray:
    """Misfit (m,) of all states together at thetas (m, t), the better element's correction included; infinite where a
    state has no equilibrium."""
    out = np.full(len(thetas), np.inf)
    for k, moved in enumerate(zip(*(state.displacements(thetas) for state in states), strict=True)):
        known = [v for v in moved if v is not None]
        if len(known) == len(states):
            out[k] = misfit.value(known, correction.at(thetas[k]))
    return out
