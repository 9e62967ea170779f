"""What a better element and other meshes change in the plain model's prediction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import ConvergenceError
from palpate.core.fem.newton import NewtonOptions
from palpate.core.fem.state import State
from palpate.core.gap.composition import Composition
from palpate.core.gap.fit import NOTHING, PLAIN, Bench, Point, carried
from palpate.core.gap.remeshed import Remeshed
from palpate.core.gap.sight import Sight
from palpate.core.gap.stage import Stage
from palpate.core.problem import IdentificationProblem
from palpate.core.worker.progress import Progress

FloatArray = NDArray[np.float64]

QUICK, GOOD = "p1p1", "p2p1"
# Rounds in which the walls of the better element find their place from where the quick one had them.
_ROUNDS = 2


def better_differences(bench: Bench, point: Point, remeshed: Sequence[Remeshed], progress: Progress) -> FloatArray:
    """(M, n) mm, the better element's residual on every mesh, the bench's own first, less the quick one's at `point`."""
    none = np.zeros(bench.sight.n)
    out = [_better_residual(_better(bench, bench.plain.problem), point)]
    for k, other in enumerate(remeshed):
        progress((k + 1) / (len(remeshed) + 1), f"plain model: mesh {k + 2}")
        problem = other.problem(bench.plain.problem)
        quick = Bench(Stage.of(problem, QUICK, bench.stage), bench.sight, Composition(problem), none)
        there = quick.solve(PLAIN, point.theta, NOTHING, None)
        if there is not None:  # a mesh on which the model has no equilibrium tells nothing
            out.append(_better_residual(_better(quick, problem), there))
    return np.array(out) - point.residual


def _better(quick: Bench, problem: IdentificationProblem) -> Bench:
    return Bench(Stage.of(problem, GOOD, quick.stage), quick.sight, quick.plain, quick.correction)


def scatter_mm(differences: FloatArray, sight: Sight) -> float:
    """rms mm along the surface, of one mesh about the mean."""
    if len(differences) < 2:
        return float("nan")
    square = differences[:, : sight.n_modes].var(axis=0, ddof=1).sum() / len(sight.modes)
    return float(np.sqrt(square))


def _better_residual(better: Bench, point: Point) -> FloatArray:
    """(n,) residual of the plain model with the better element, from the quick one's equilibrium: their pressures share their nodes."""
    scene = better.stage.scene(better.plain)
    state = State(carried(point, scene), point.equilibrium.p)
    for _ in range(_ROUNDS):
        scene.linearise(state.u)
        found = scene.solve(point.theta, state, NewtonOptions(rtol=1e-5, stability=False))
        if not found.converged:
            afresh = better.solve(PLAIN, point.theta, NOTHING, None)
            if afresh is None:
                raise ConvergenceError("the better element finds no equilibrium; mesh more finely")
            return afresh.residual
        state = State(found.u, found.p)
    return better.sight.residual(scene, state.u)
