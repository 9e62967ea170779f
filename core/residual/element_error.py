"""Discretisation error of the plain model: what a better element, and other meshes, change in its prediction."""

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
# Where cells fold it may find no equilibrium from there, and fight for minutes: it is given a fifth of what a solve may
# take.
OPTIONS = NewtonOptions(rtol=1e-5, stability=False, max_factorisations=40)


@dataclass(frozen=True, eq=False)
class ElementErrors:
    """What the better element changes, mm.

    every (M, n) : on each mesh on which it has an equilibrium; M may be 0. own (n,) : on the case's own mesh, None
    where it has none.
    """

    every: FloatArray
    own: FloatArray | None


def element_errors(
    model: StateModel, linearisation: Linearisation, remeshed: Sequence[Remeshed], progress: Progress
) -> ElementErrors:
    """Residual of the better element on every mesh, the model's own first, less that of the quick one at
    `linearisation`."""
    none = np.zeros(model.data.n)
    residuals = [fine_element_residual(fine_element_model(model), PLAIN, linearisation)]
    for k, other in enumerate(remeshed):
        progress((k + 1) / (len(remeshed) + 1), f"plain model: mesh {k + 2}")
        problem = other.problem(model.plain.problem)
        quick = StateModel(SharedGeometry.of(problem, QUICK, model.geometry), model.data, Composition(problem), none)
        there = quick.solve(PLAIN, linearisation.theta, NOTHING, None)
        if there is not None:  # a mesh on which the model has no equilibrium tells nothing
            residuals.append(fine_element_residual(fine_element_model(quick), PLAIN, there))
    known = [r for r in residuals if r is not None]
    every = np.array(known) - linearisation.residual if known else np.zeros((0, len(none)))
    return ElementErrors(every, None if residuals[0] is None else every[0])


def fine_element_model(quick: StateModel) -> StateModel:
    """The same model with the better element."""
    return StateModel(
        SharedGeometry.of(quick.plain.problem, GOOD, quick.geometry), quick.data, quick.plain, quick.correction
    )


def scatter_mm(differences: FloatArray, data: DataVector) -> float:
    """Scatter (rms along the surface, mm) of one mesh about the mean of all."""
    if len(differences) < 2:
        return float("nan")
    square = differences[:, : data.n_modes].var(axis=0, ddof=1).sum() / len(data.modes)
    return float(np.sqrt(square))


def fine_element_residual(
    better: StateModel, hypothesis: Hypothesis, linearisation: Linearisation, options: NewtonOptions = OPTIONS
) -> FloatArray | None:
    """Residual (n,) of the better element, started from the quick one's equilibrium, whose pressure unknowns it shares.

    None where it has no equilibrium within what the options allow.
    """
    scene = CompositionScene(better.geometry, hypothesis.composition(better.plain, linearisation.phi))
    state = State(carried(linearisation, scene), linearisation.equilibrium.p)
    for _ in range(_ROUNDS):
        scene.linearise(state.u)
        equilibrium = scene.solve(linearisation.theta, state, options)
        if not equilibrium.converged:
            return None
        state = State(equilibrium.u, equilibrium.p)
    return better.data.residual(scene, state.u)
