"""From a problem file to stiffnesses with their uncertainty: reference, search, posterior."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import ConvergenceError
from palpate.core.fem.newton import Equilibrium
from palpate.core.identify import particles
from palpate.core.identify.again import keep_for_again
from palpate.core.identify.coupled import prolonged
from palpate.core.identify.evaluation import Evaluator
from palpate.core.identify.misfit import Misfit
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.posterior import NoiseFacts, Posterior, laplace
from palpate.core.identify.reference import Counter, Optimum, Walk, find_optimum, middle, settle_first
from palpate.core.identify.scene import Scene, make_scene
from palpate.core.identify.search import SwarmOutcome, run_swarm
from palpate.core.problem import IdentificationProblem
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint
from palpate.core.worker.executors import make_executor
from palpate.core.worker.messages import Reporter

FloatArray = NDArray[np.float64]

# The element that looks for the optimum first; the chosen one starts where it ended.
SCOUT = "p1p1"


@dataclass(frozen=True, eq=False)
class Identification:
    """The answer of one identification.

    theta (t,) as in `StiffnessParameters`; equilibrium there with the walls settled; posterior of all of theta; the Gauss-Newton
    optimum and, with method "swarm", the swarm's outcome. agreement : largest difference between their ln G (0 without a swarm).
    """

    scene: Scene
    misfit: Misfit
    theta: FloatArray
    equilibrium: Equilibrium
    residual: FloatArray
    jacobian: FloatArray
    posterior: Posterior
    optimum: Optimum
    swarm: SwarmOutcome | None
    count: Counter
    seconds: float

    @property
    def agreement(self) -> float:
        """Largest |difference| of ln G between swarm and Gauss-Newton."""
        if self.swarm is None:
            return 0.0
        return float(np.abs(self.swarm.theta - self.optimum.fit.theta)[self.scene.parameters.stiffness].max())

    @property
    def stiffness(self) -> Posterior:
        """Of the regions' ln G, whatever else was looked for."""
        return self.posterior.of(self.scene.parameters.stiffness)


def identify(folder: Path, options: IdentifyOptions, fingerprint: str, reporter: Reporter) -> Identification:
    """Identify the problem in folder/problem.npz; checkpoints go beside it, and a rerun with the same fingerprint goes on.

    Raises InputError for a problem that cannot be posed, ConvergenceError when nothing can be solved.
    """
    began = time.perf_counter()
    count = Counter()
    reporter.progress(0.0, "building the model")
    problem = IdentificationProblem.load(folder / "problem.npz")
    scout = _scout(problem, options, count, reporter)
    scene = make_scene(problem, options.boundary, options.element, options.split_mu)
    reporter.progress(0.15, f"settling the walls, element {options.element}")
    first, misfit = settle_first(scene, scout.fit.theta, count, prolonged(scout.equilibrium.u, scene.space))
    starts = scout.fit.theta[None]
    optimum = find_optimum(scene, misfit, first, starts, count, lambda f, m: reporter.progress(0.2 + 0.1 * f, m))
    optimum = replace(optimum, others=scout.others, scout=scout.fit.theta)
    swarm = None
    theta = optimum.fit.theta
    if options.method == "swarm":
        swarm = _swarm(folder, misfit, optimum, options, fingerprint, reporter, count)
        theta = swarm.theta
    reporter.progress(0.92, "uncertainty")
    walk = Walk(scene, misfit, optimum.equilibrium, count)
    linear, best = walk.linearise(theta), walk.best
    if linear is None or best is None:  # the swarm's best has no equilibrium once the walls have settled anew
        theta, linear, best = optimum.fit.theta, (optimum.fit.residual, optimum.fit.jacobian), optimum.equilibrium
    noise = NoiseFacts(misfit.score_covariance(linear[1]), misfit.expected)
    posterior = laplace(theta, *linear, scene.parameters.bounds, noise)
    seconds = time.perf_counter() - began
    residual, jacobian = linear
    return Identification(scene, misfit, theta, best, residual, jacobian, posterior, optimum, swarm, count, seconds)


def _scout(problem: IdentificationProblem, options: IdentifyOptions, count: Counter, reporter: Reporter) -> Optimum:
    """Several starts with the cheap element: where the optimum is about, and whether there is one only."""
    scene = make_scene(problem, options.boundary, SCOUT, options.split_mu)
    reporter.progress(0.03, "settling the walls")
    starts = _starts(scene, options)
    first, misfit = _settle_somewhere(scene, starts, count)
    return find_optimum(scene, misfit, first, starts, count, lambda f, m: reporter.progress(0.05 + 0.1 * f, m))


def _settle_somewhere(scene: Scene, thetas: FloatArray, count: Counter) -> tuple[Equilibrium, Misfit]:
    """Settle at the first theta (s, t) that has an equilibrium: a dead load crushes an organ that is far too soft."""
    for theta in thetas[:-1]:
        try:
            return settle_first(scene, theta, count)
        except ConvergenceError:
            continue
    return settle_first(scene, thetas[-1], count)


def _swarm(
    folder: Path,
    misfit: Misfit,
    optimum: Optimum,
    options: IdentifyOptions,
    fingerprint: str,
    reporter: Reporter,
    count: Counter,
) -> SwarmOutcome:
    """The swarm around the reference: one file tells every process where the walls are and where to start from."""
    scene, found = misfit.scene, optimum.equilibrium
    reference = folder / "reference.npz"
    if load_checkpoint(reference, fingerprint) is None:
        arrays = {"u": found.u, "p": found.p, "walls_u": scene.linearised_at}
        save_checkpoint(reference, arrays, fingerprint)
    arguments = (str(folder / "problem.npz"), str(reference), options.boundary, options.element, options.split_mu)
    bounds = scene.parameters.bounds
    with make_executor(options.workers, particles.initialise, arguments) as executor:
        evaluator = Evaluator(misfit, executor)
        if options.reduced:
            told = lambda f, m: reporter.progress(0.3 + 0.3 * f, f"reduced model: {m}")  # noqa: E731
            evaluator.build_reduced(bounds, fingerprint, folder / "reduced.npz", told)
            keep_for_again(folder, misfit, options, fingerprint)
        outcome = run_swarm(evaluator, bounds, options, folder / "swarm.npz", fingerprint, reporter)
    count.solves += evaluator.full_solves
    count.factorisations += evaluator.factorisations
    count.failed += evaluator.failed
    count.reduced += evaluator.reduced_evaluations
    return outcome


def _starts(scene: Scene, options: IdentifyOptions) -> FloatArray:
    """The middle of the bounds, then points spread by the golden ratio: the same for everyone, no random numbers needed."""
    bounds = scene.parameters.bounds
    n = len(bounds)
    golden = np.array([1.0 / _plastic(n) ** (k + 1) for k in range(n)])
    share = (0.5 + np.outer(np.arange(1, options.starts), golden)) % 1.0
    spread = bounds[:, 0] + (0.15 + 0.7 * share) * (bounds[:, 1] - bounds[:, 0])
    return np.vstack([middle(bounds)[None], spread])


def _plastic(n: int) -> float:
    """Root of x^(n+1) = x + 1: the golden ratio and its kin (Roberts 2018, R-sequences)."""
    x = 1.5
    for _ in range(60):
        x = (1.0 + x) ** (1.0 / (n + 1))
    return x
