"""The search of Yang & Lin (Eqs 11 to 19) for a figure's stiffness: a swarm over the ratios, the forces fitted for each
particle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.applications.sketch.figure import Figure
from palpate.applications.sketch.fit import Fit, fit_degree
from palpate.applications.sketch.fit_walk import RATIO_BOUNDS, RATIO_SD, FitOptions
from palpate.applications.sketch.residual import Target
from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.inference.swarm import Swarm, SwarmOptions
from palpate.core.worker.progress import Progress, silent

# Gauss-Newton steps for the forces of one particle, which begins at its nearest neighbour's.
_STEPS = 8


@dataclass(frozen=True)
class SwarmFitOptions:
    """As in `SwarmOptions`; fewer particles than for an organ, because the particles' coordinates are the ratios
    alone.
    """

    particles: int = 12
    iterations: int = 8
    seed: int = 1


def swarm_fit(
    figure: Figure,
    targets: tuple[Target, ...],
    start: Fit,
    fit_options: FitOptions | None = None,
    options: SwarmFitOptions | None = None,
    progress: Progress = silent,
) -> tuple[Fit, FloatArray]:
    """The fit of the best particle, at the degree of `start`, and the best misfit after every iteration.

    Raises ConvergenceError when no particle has an equilibrium.
    """
    options = options or SwarmFitOptions()
    fit_options = FitOptions((fit_options or FitOptions()).line_error, _STEPS)
    n = len(figure.parts) - 1
    low, high = (np.full(n, bound) for bound in RATIO_BOUNDS)
    swarm = Swarm(
        low, high, options.seed, SwarmOptions(options.particles, max_iterations=options.iterations, collapse=1e-3)
    )
    known, best, lowest = [start], start, np.inf
    while not swarm.should_stop():
        values = []
        for theta in swarm.ask():
            near = _nearest(known, theta)
            fitted = _forces_at(figure, targets, theta, near, fit_options)
            value = np.inf if fitted is None else fitted.misfit + float(((theta / RATIO_SD) ** 2).sum())
            values.append(value)
            if fitted is not None:
                known.append(fitted)
                best, lowest = (fitted, value) if value < lowest else (best, lowest)
        swarm.tell(values)
        progress(swarm.iteration / options.iterations, f"swarm, best misfit {swarm.best_value:.4g}")
    if not np.isfinite(lowest):
        raise ConvergenceError(
            "no particle of the swarm has an equilibrium near the keyframes; draw them nearer to each other"
        )
    return best, swarm.history[0]


def _nearest(known: list[Fit], theta: FloatArray) -> Fit:
    return min(known, key=lambda fit: float(np.abs(fit.theta - theta).max()))


def _forces_at(
    figure: Figure, targets: tuple[Target, ...], theta: FloatArray, near: Fit, options: FitOptions
) -> Fit | None:
    try:
        return fit_degree(figure, targets, near.degree, near, options, fixed=theta)
    except ConvergenceError:
        return None
