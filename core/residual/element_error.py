"""What a better element and other meshes change in the plain model's prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import NewtonOptions
from palpate.core.fem.state import State
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.linearised_model import NOTHING, PLAIN, Hypothesis, Linearisation, StateModel, carried
from palpate.core.residual.remeshing import Remeshed
from palpate.core.worker.progress import Progress

QUICK, GOOD = "p1p1", "p2p1"
# Rounds in which the walls of the better element find their place from where the quick one had them.
_ROUNDS = 2
# Where cells fold it may find no equilibrium from there, and fight for minutes: it is given a fifth of what a solve may take.
OPTIONS = NewtonOptions(rtol=1e-5, stability=False, max_factorisations=40)


@dataclass(frozen=True, eq=False)
class Differences:
    """What the better element changes, mm. every (M, n) : each mesh on which it finds an equilibrium, M may be 0; own (n,) : the first."""

    every: FloatArray
    own: FloatArray | None


def better_differences(
    bench: StateModel, point: Linearisation, remeshed: Sequence[Remeshed], progress: Progress
) -> Differences:
    """The better element's residual on every mesh, the bench's own first, less the quick one's at `point`."""
    none = np.zeros(bench.sight.n)
    found = [better_residual(better_bench(bench), PLAIN, point)]
    for k, other in enumerate(remeshed):
        progress((k + 1) / (len(remeshed) + 1), f"plain model: mesh {k + 2}")
        problem = other.problem(bench.plain.problem)
        quick = StateModel(SharedGeometry.of(problem, QUICK, bench.stage), bench.sight, Composition(problem), none)
        there = quick.solve(PLAIN, point.theta, NOTHING, None)
        if there is not None:  # a mesh on which the model has no equilibrium tells nothing
            found.append(better_residual(better_bench(quick), PLAIN, there))
    known = [r for r in found if r is not None]
    every = np.array(known) - point.residual if known else np.zeros((0, len(none)))
    return Differences(every, None if found[0] is None else every[0])


def better_bench(quick: StateModel) -> StateModel:
    """The same problem with the better element."""
    return StateModel(
        SharedGeometry.of(quick.plain.problem, GOOD, quick.stage), quick.sight, quick.plain, quick.correction
    )


def scatter_mm(differences: FloatArray, sight: DataVector) -> float:
    """rms mm along the surface, of one mesh about the mean."""
    if len(differences) < 2:
        return float("nan")
    square = differences[:, : sight.n_modes].var(axis=0, ddof=1).sum() / len(sight.modes)
    return float(np.sqrt(square))


def better_residual(
    better: StateModel, trial: Hypothesis, point: Linearisation, options: NewtonOptions = OPTIONS
) -> FloatArray | None:
    """(n,) residual with the better element, from the quick one's equilibrium of the trial: their pressures share their nodes.

    None where it finds no equilibrium within what options allow.
    """
    scene = CompositionScene(better.stage, trial.composition(better.plain, point.phi))
    state = State(carried(point, scene), point.equilibrium.p)
    for _ in range(_ROUNDS):
        scene.linearise(state.u)
        found = scene.solve(point.theta, state, options)
        if not found.converged:
            return None
        state = State(found.u, found.p)
    return better.sight.residual(scene, state.u)
