"""From a problem file to stiffnesses with their uncertainty: reference, search, posterior."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.core.fem.newton import Equilibrium
from palpate.core.identify.coupled import CoupledScene, SceneOptions
from palpate.core.identify.misfit import Misfit
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.posterior import Posterior, laplace
from palpate.core.identify.reference import Counter, Optimum, Walk, find_optimum, middle, settle_first
from palpate.core.identify.search import SwarmOutcome, run_swarm
from palpate.core.problem import IdentificationProblem
from palpate.core.worker.progress import Progress

FloatArray = NDArray[np.float64]
MakeExecutor = Callable[[int, Callable[..., None], tuple[object, ...]], Executor]


@dataclass(frozen=True, eq=False)
class Identification:
    """The answer of one identification.

    theta (t,) = ln G; equilibrium there with the walls settled; posterior; the Gauss-Newton optimum and, with method "swarm",
    the swarm's outcome. agreement : largest difference between their ln G (0 without a swarm).
    """

    scene: CoupledScene
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
        return 0.0 if self.swarm is None else float(np.abs(self.swarm.theta - self.optimum.fit.theta).max())


def identify(
    folder: Path,
    options: IdentifyOptions,
    make_executor: MakeExecutor,
    progress: Progress,
    cancelled: Callable[[], None],
) -> Identification:
    """Identify the problem in folder/problem.npz; checkpoints go beside it and a rerun goes on from them.

    Raises InputError for a problem that cannot be posed, ConvergenceError when nothing can be solved, Cancelled.
    """
    began = time.perf_counter()
    count = Counter()
    problem_file, reference_file = folder / "problem.npz", folder / "reference.npz"
    progress(0.0, "building the model")
    scene = CoupledScene(IdentificationProblem.load(problem_file), SceneOptions(element=options.element))
    cancelled()
    progress(0.05, "settling the walls")
    first, misfit = settle_first(scene, count)
    cancelled()
    optimum = find_optimum(
        scene, misfit, first, _starts(scene, options), count, lambda f, m: progress(0.1 + 0.2 * f, m)
    )
    cancelled()
    swarm = None
    theta = optimum.fit.theta
    if options.method == "swarm":
        if not (folder / "swarm.npz").exists() or not reference_file.exists():
            _save_reference(reference_file, scene, optimum)
        arguments = (str(problem_file), str(reference_file), options.element)
        from palpate.core.identify import particles

        with make_executor(options.workers, particles.initialise, arguments) as executor:
            swarm = run_swarm(
                executor,
                scene.parameters.bounds,
                options,
                folder / "swarm.npz",
                lambda f, m: progress(0.3 + 0.6 * f, m),
                cancelled,
            )
        theta = swarm.theta
        count.solves += swarm.evaluations
        count.factorisations += swarm.factorisations
        count.failed += swarm.failed
    progress(0.92, "uncertainty")
    walk = Walk(scene, misfit, optimum.equilibrium, count)
    linear = walk.linearise(theta)
    if linear is None or walk.best is None:  # the swarm's best lies where the settled walls have no equilibrium
        theta, linear, best = optimum.fit.theta, (optimum.fit.residual, optimum.fit.jacobian), optimum.equilibrium
    else:
        best = walk.best
    posterior = laplace(theta, *linear, scene.parameters.bounds)
    seconds = time.perf_counter() - began
    return Identification(
        scene, misfit, theta, best, linear[0], linear[1], posterior, optimum, swarm, replace(count), seconds
    )


def _starts(scene: CoupledScene, options: IdentifyOptions) -> FloatArray:
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


def _save_reference(path: Path, scene: CoupledScene, optimum: Optimum) -> None:
    found = optimum.equilibrium
    temporary = path.with_name(f".{path.name}.tmp.npz")
    np.savez(temporary, theta=optimum.fit.theta, u=found.u, p=found.p, walls_u=found.u)
    os.replace(temporary, path)
