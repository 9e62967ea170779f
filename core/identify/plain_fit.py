"""Gauss-Newton fit of an identification: settled walls, propagated contour noise, optimum from several starts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.state import State
from palpate.core.forward.make_scene import Scene
from palpate.core.identify.misfit import Misfit, wall_response
from palpate.core.identify.uneven_regions import UNEVEN_SD, uneven_responses
from palpate.core.inference.gauss_newton import GaussNewtonResult, gauss_newton
from palpate.core.inference.posterior import NoiseFacts
from palpate.core.worker.progress import Progress

# Largest difference of ln G at which the optima of two starts count as the same.
SAME_OPTIMUM = 0.05


@dataclass
class Counter:
    """Work done so far.

    solves : equilibria. factorisations : of the tangent. failed : solves without an equilibrium. reduced : evaluations
    of the reduced model.
    """

    solves: int = 0
    factorisations: int = 0
    failed: int = 0
    reduced: int = 0

    def add(self, equilibrium: Equilibrium) -> None:
        """Count one equilibrium."""
        self.solves += 1
        self.factorisations += equilibrium.factorisations
        self.failed += 0 if equilibrium.converged else 1


@dataclass(frozen=True, eq=False)
class StateProblem:
    """One deformed state: its scene, its weighted data and an equilibrium to start from."""

    scene: Scene
    misfit: Misfit
    equilibrium: Equilibrium


def noise_of(states: Sequence[StateProblem], jacobian: FloatArray) -> NoiseFacts:
    """Noise statistics of the weighted residual of all states, for its Jacobian (rows of all states, t)."""
    score, expected, row = np.zeros((jacobian.shape[1],) * 2), 0.0, 0
    for state in states:
        score += state.misfit.score_covariance(jacobian[row : row + state.misfit.rows])
        expected += state.misfit.expected
        row += state.misfit.rows
    return NoiseFacts(score, expected)


@dataclass(frozen=True, eq=False)
class Optimum:
    """Result of Gauss-Newton from several starts.

    fit : result of the best start. equilibria : of every state at the optimum, walls settled. others : (starts, t)
    theta at the end of every start that converged to an equilibrium. scout : (t,) the best of them where they were
    computed with another element. stiffness : rows of theta that are ln G.
    """

    fit: GaussNewtonResult
    equilibria: tuple[Equilibrium, ...]
    others: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    scout: FloatArray | None = None
    stiffness: slice = field(default_factory=lambda: slice(None))

    @property
    def agree(self) -> bool:
        """Whether all starts end at the same stiffnesses."""
        centre = self.fit.theta if self.scout is None else self.scout
        return bool((np.abs(self.others - centre)[:, self.stiffness] < SAME_OPTIMUM).all())


def settle_first(
    scene: Scene, theta: FloatArray, count: Counter, start: FloatArray | None = None, uneven: bool = False
) -> tuple[Equilibrium, Misfit]:
    """Equilibrium with settled walls at theta, and the misfit weighted by its propagated errors.

    start : (n, 3) mm, displacements to start from. uneven : count the heterogeneity of regions as an error, see
    `uneven_responses`. Raises ConvergenceError when the model has no equilibrium.
    """
    scene.assembler.set_materials(scene.parameters.materials(theta))
    state = None if start is None else State(start, scene.assembler.balanced_pressure(start))
    settled = scene.settle(theta, state)
    count.add(settled.equilibrium)
    if not settled.equilibrium.converged:
        raise ConvergenceError(
            f"the rest anatomy cannot be deformed into what the second scan shows: {settled.equilibrium.reason}; "
            "look at the contours of bladder and rectum, or mesh more finely"
        )
    equilibrium = settled.equilibrium
    errors = [wall_response(scene, equilibrium)]
    if uneven:
        observe = lambda field: scene.observation.jacobian(equilibrium.u, field[None])[:, 0]  # noqa: E731
        responses = uneven_responses(scene.assembler, scene.parameters, theta, equilibrium, observe)
        errors += [UNEVEN_SD * response for response in responses]
    return equilibrium, Misfit.of(scene, *errors)


def find_optimum(states: Sequence[StateProblem], starts: FloatArray, count: Counter, progress: Progress) -> Optimum:
    """Gauss-Newton on the sum of the states' misfits, from each start (s, t). Raises ConvergenceError when no start has
    an equilibrium.
    """
    parameters = states[0].scene.parameters
    best: tuple[GaussNewtonResult, tuple[Equilibrium, ...]] | None = None
    ends = []
    for k, start in enumerate(starts):
        # The number of equilibria of a start is unknown, so its fraction approaches 1 asymptotically.
        report = lambda solved, k=k: progress(  # noqa: E731
            (k + solved / (solved + 6.0)) / len(starts),
            f"Gauss-Newton, start {k + 1} of {len(starts)}, equilibrium {solved + 1}",
        )
        walk = Continuation(states, count, report)
        fit = gauss_newton(walk.linearise, start, parameters.bounds)
        if fit is None or not walk.best:
            continue
        ends.append(fit.theta)
        if best is None or fit.misfit < best[0].misfit:
            best = fit, walk.best
    if best is None:
        raise ConvergenceError("no start of Gauss-Newton could be solved; look at the mesh and at the contours")
    return Optimum(best[0], best[1], np.array(ends), stiffness=parameters.stiffness)


class Continuation:
    """Linearisation of the states' misfits along a path of thetas. Each equilibrium starts from the one before.

    best : equilibria of all states at the smallest sum of misfits, empty before the first. told : called before each
    solve with the number of equilibria solved.
    """

    def __init__(
        self, states: Sequence[StateProblem], count: Counter, told: Callable[[int], None] = lambda _: None
    ) -> None:
        self.states, self.count = states, count
        self._told, self._solved = told, 0
        self.last = [state.equilibrium for state in states]
        self.best: tuple[Equilibrium, ...] = ()
        self._lowest = np.inf

    def linearise(self, theta: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Whitened residual and Jacobian of all states at theta, walls settled; None when one state has no equilibrium."""
        residuals, jacobians = [], []
        for k, state in enumerate(self.states):
            self._told(self._solved)
            self._solved += 1
            equilibrium = state.scene.settle(theta, self.last[k], rounds=2).equilibrium
            self.count.add(equilibrium)
            if not equilibrium.converged:
                return None
            self.last[k] = equilibrium
            residuals.append(state.misfit.residual(equilibrium.u))
            jacobians.append(
                state.misfit.jacobian(equilibrium.u, state.scene.displacement_sensitivities(theta, equilibrium))
            )
        residual = np.concatenate(residuals)
        if residual @ residual < self._lowest:
            self._lowest, self.best = float(residual @ residual), tuple(self.last)
        return residual, np.vstack(jacobians)
