"""Identification of region stiffness with its uncertainty: rest state, search for the optimum, posterior."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.forward.make_scene import Scene, make_scene
from palpate.core.forward.parameters import middle
from palpate.core.forward.scene_parts import prolonged
from palpate.core.identify.misfit import Misfit
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.plain_fit import (
    Continuation,
    Counter,
    Optimum,
    StateProblem,
    find_optimum,
    noise_of,
    settle_first,
)
from palpate.core.identify.swarm_run import SwarmOutcome
from palpate.core.identify.swarm_stage import search_with_swarm
from palpate.core.inference.posterior import Posterior, laplace
from palpate.core.problem import IdentificationProblem
from palpate.core.worker.messages import Reporter

# Element of the first, cheap search for the optimum. The search with the chosen element starts from its result.
SCOUT = "p1p1"


@dataclass(frozen=True, eq=False)
class Identification:
    """Result of one identification.

    states : the deformed states, each with its equilibrium at theta and its walls settled. theta : (t,) parameters as
    in `StiffnessParameters`. residual : (q,) weighted residual of all states. jacobian : (q, t) its derivative in
    theta. posterior : of all of theta. optimum : result of Gauss-Newton. swarm : result of the swarm, None without that
    method. count : work done. seconds : wall-clock time.
    """

    states: tuple[StateProblem, ...]
    theta: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    posterior: Posterior
    optimum: Optimum
    swarm: SwarmOutcome | None
    count: Counter
    seconds: float

    @property
    def scene(self) -> Scene:
        """Scene of the first state, the one that pictures show."""
        return self.states[0].scene

    @property
    def misfit(self) -> Misfit:
        """Misfit of the first state."""
        return self.states[0].misfit

    @property
    def equilibrium(self) -> Equilibrium:
        """Equilibrium of the first state."""
        return self.states[0].equilibrium

    @property
    def agreement(self) -> float:
        """Largest absolute difference of ln G between swarm and Gauss-Newton; 0 without a swarm."""
        if self.swarm is None:
            return 0.0
        return float(np.abs(self.swarm.theta - self.optimum.fit.theta)[self.scene.parameters.stiffness].max())

    @property
    def stiffness(self) -> Posterior:
        """Marginal posterior of the regions' ln G."""
        return self.posterior.of(self.scene.parameters.stiffness)


def identify(
    folder: Path, files: Sequence[Path], options: IdentifyOptions, fingerprint: str, reporter: Reporter
) -> Identification:
    """One stiffness for several deformed states of the same mesh: the sum of their misfits is minimised.

    files : problem file of each state. Checkpoints are written into `folder`; a later run with the same fingerprint
    continues from them. Raises InputError for a problem that cannot be set up, ConvergenceError when no start of the
    search has an equilibrium.
    """
    began = time.perf_counter()
    count = Counter()
    reporter.progress(0.0, "building the model")
    problems = [IdentificationProblem.load(file) for file in files]
    scout = _scout(problems, options, count, reporter)
    reporter.progress(0.15, f"settling the walls, element {options.element}")
    states = [_posed(p, scout, k, options, count) for k, p in enumerate(problems)]
    parameters = states[0].scene.parameters
    starts = scout.fit.theta[None]
    optimum = find_optimum(states, starts, count, lambda f, m: reporter.progress(0.2 + 0.1 * f, m))
    optimum = replace(optimum, others=scout.others, scout=scout.fit.theta)
    states = _at(states, optimum.equilibria)
    swarm = None
    theta = optimum.fit.theta
    if options.method == "swarm":
        swarm = search_with_swarm(folder, files, states, options, fingerprint, reporter, count)
        theta = swarm.theta
    reporter.progress(0.92, "uncertainty")
    walk = Continuation(states, count)
    linear, best = walk.linearise(theta), walk.best
    if linear is None:  # no equilibrium at the swarm's best after the walls have settled anew
        theta, linear, best = optimum.fit.theta, (optimum.fit.residual, optimum.fit.jacobian), optimum.equilibria
    posterior = laplace(theta, *linear, parameters.bounds, noise_of(states, linear[1]))
    seconds = time.perf_counter() - began
    return Identification(tuple(_at(states, best)), theta, *linear, posterior, optimum, swarm, count, seconds)


def _at(states: Sequence[StateProblem], equilibria: Sequence[Equilibrium]) -> list[StateProblem]:
    return [replace(state, equilibrium=equilibrium) for state, equilibrium in zip(states, equilibria, strict=True)]


def _posed(
    problem: IdentificationProblem, scout: Optimum, k: int, options: IdentifyOptions, count: Counter
) -> StateProblem:
    """State k with the chosen element, started from the equilibrium of the first search."""
    scene = make_scene(problem, options.boundary, options.element, options.split_mu)
    first, misfit = settle_first(
        scene, scout.fit.theta, count, prolonged(scout.equilibria[k].u, scene.space), options.uneven
    )
    return StateProblem(scene, misfit, first)


def _scout(
    problems: Sequence[IdentificationProblem], options: IdentifyOptions, count: Counter, reporter: Reporter
) -> Optimum:
    """Search with the cheap element from several starts: approximate optimum, and whether all starts agree."""
    reporter.progress(0.03, "settling the walls")
    states = []
    for problem in problems:
        scene = make_scene(problem, options.boundary, SCOUT, options.split_mu)
        starts = _starts(scene, options)
        first, misfit = _settle_somewhere(scene, starts, count)
        states.append(StateProblem(scene, misfit, first))
    return find_optimum(states, starts, count, lambda f, m: reporter.progress(0.05 + 0.1 * f, m))


def _settle_somewhere(scene: Scene, thetas: FloatArray, count: Counter) -> tuple[Equilibrium, Misfit]:
    """Walls settled at the first theta of (s, t) that has an equilibrium. A dead load crushes an organ that is far too
    soft.
    """
    for theta in thetas[:-1]:
        try:
            return settle_first(scene, theta, count)
        except ConvergenceError:
            continue
    return settle_first(scene, thetas[-1], count)


def _starts(scene: Scene, options: IdentifyOptions) -> FloatArray:
    """(s, t) start points: the middle of the bounds, then a deterministic low-discrepancy sequence (R-sequence, Roberts
    2018).
    """
    bounds = scene.parameters.bounds
    n = len(bounds)
    golden = np.array([1.0 / _plastic(n) ** (k + 1) for k in range(n)])
    share = (0.5 + np.outer(np.arange(1, options.starts), golden)) % 1.0
    spread = bounds[:, 0] + (0.15 + 0.7 * share) * (bounds[:, 1] - bounds[:, 0])
    return np.vstack([middle(bounds)[None], spread])


def _plastic(n: int) -> float:
    """Root of x^(n+1) = x + 1, the generalised golden ratio of the R-sequences (Roberts 2018)."""
    x = 1.5
    for _ in range(60):
        x = (1.0 + x) ** (1.0 / (n + 1))
    return x
