"""Discretisation error of the plain model: what a better element, and other meshes, change in its prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import NewtonOptions
from palpate.core.fem.sensitivity import direct
from palpate.core.fem.state import State
from palpate.core.fem.tangent import Tangent
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.contact_force_scene import ContactForceScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.fit_options import GOOD, QUICK
from palpate.core.residual.linearised_model import NOTHING, PLAIN, Hypothesis, Linearisation, StateModel, carried
from palpate.core.residual.noise_covariance import ContourResponses
from palpate.core.residual.remeshing import Remeshed
from palpate.core.worker.progress import Progress, silent

# Rounds in which the walls of the better element find their place from where the quick one had them.
_ROUNDS = 2
# Where cells fold it may find no equilibrium from there, and fight for minutes: it is given a fifth of what a solve may
# take.
OPTIONS = NewtonOptions(rtol=1e-5, stability=False, max_factorisations=40)


@dataclass(frozen=True, eq=False)
class FineSolution:
    """Equilibrium of the better element: its scene, the state, and the residual (n,) there, without a correction.

    responses : to errors of the contours. in_theta (n, t) : derivative of the residual. Both are None where they were not
    asked for.
    """

    scene: CompositionScene
    state: State
    residual: FloatArray
    responses: ContourResponses | None = None
    in_theta: FloatArray | None = None

    def linearised(self, data: DataVector, theta: FloatArray, contours: bool = False) -> FineSolution:
        """The same with what ln G does to the data, at its own theta (t,), and errors of the contours if asked for.

        Precondition: its scene was the last that its assembler solved.
        """
        tangent = Tangent(self.scene.assembler, self.state)
        moves = direct(tangent, self.scene.directions(theta))
        in_theta = data.response(self.scene, self.state.u, moves)
        responses = ContourResponses.of(self.scene, data, self.state.u, tangent) if contours else None
        return replace(self, responses=responses, in_theta=in_theta)


@dataclass(frozen=True, eq=False)
class ElementErrors:
    """What the better element changes, mm.

    every (M, n) : on each mesh on which it has an equilibrium; M may be 0. own : its solution on the case's own mesh,
    None where it has none. quick (n,) : residual of the quick element that this is counted from, at theta (t,). slope
    (n, t) : what it changes of the derivative in theta there, on the case's own mesh.
    """

    every: FloatArray
    own: FineSolution | None
    quick: FloatArray
    theta: FloatArray
    slope: FloatArray

    @property
    def on_own_mesh(self) -> FloatArray | None:
        """What it changes (n,) on the case's own mesh; None where it has no equilibrium."""
        return None if self.own is None else self.own.residual - self.quick

    def mean(self) -> FloatArray:
        """Mean (n,) over all meshes, 0 where there is none."""
        return np.asarray(self.every.mean(axis=0)) if len(self.every) else np.zeros(self.every.shape[1])

    @property
    def correction(self) -> ElementCorrection:
        """What it adds to the residual."""
        return ElementCorrection(self.theta, self.mean(), self.slope)

    def moved_to(self, model: StateModel, linearisation: Linearisation, element: str) -> ElementErrors:
        """The same at another linearisation, solved on the case's own mesh; other meshes change as much.

        Unchanged where the better element has no equilibrium there, or had none before.
        """
        if self.own is None:
            return self
        own = fine_solution(fine_element_model(model, element), PLAIN, linearisation)
        if own is None:
            return self
        own = own.linearised(model.data, linearisation.theta)
        quick = linearisation.residual - model.correction.at(linearisation.theta)
        change = (own.residual - quick) - (self.own.residual - self.quick)
        return ElementErrors(self.every + change, own, quick, linearisation.theta, _slope(own, model, linearisation))


def element_errors(
    model: StateModel,
    linearisation: Linearisation,
    remeshed: Sequence[Remeshed],
    element: str,
    progress: Progress = silent,
) -> ElementErrors:
    """Residual of the better element on every mesh, the model's own first, less that of the quick one at
    `linearisation`."""
    theta, none = linearisation.theta, ElementCorrection.none(model.data.n)
    quick_residual = linearisation.residual - model.correction.at(theta)
    same = np.zeros_like(linearisation.in_theta)
    if element == QUICK:
        return ElementErrors(np.zeros((0, model.data.n)), None, quick_residual, theta, same)
    own = fine_solution(fine_element_model(model, element), PLAIN, linearisation)
    own = None if own is None else own.linearised(model.data, theta, contours=True)
    residuals = [None if own is None else own.residual]
    for k, other in enumerate(remeshed):
        progress((k + 1) / (len(remeshed) + 1), f"plain model: mesh {k + 2}")
        problem = other.problem(model.plain.problem)
        quick = StateModel(SharedGeometry.of(problem, QUICK, model.geometry), model.data, Composition(problem), none)
        there = quick.solve(PLAIN, theta, NOTHING, None)
        if there is not None:  # a mesh on which the model has no equilibrium tells nothing
            residuals.append(fine_element_residual(fine_element_model(quick, element), PLAIN, there))
    known = [r for r in residuals if r is not None]
    every = np.array(known) - quick_residual if known else np.zeros((0, model.data.n))
    slope = same if own is None else _slope(own, model, linearisation)
    return ElementErrors(every, own, quick_residual, theta, slope)


def _slope(own: FineSolution, model: StateModel, linearisation: Linearisation) -> FloatArray:
    """What the better element changes (n, t) of the quick one's derivative in theta."""
    assert own.in_theta is not None
    return own.in_theta - (linearisation.in_theta - model.correction.in_theta(linearisation.theta))


def fine_element_model(quick: StateModel, element: str = GOOD) -> StateModel:
    """The same model with the better element."""
    geometry = quick.geometry.with_element(element)
    only = None if quick.only is None else ContactForceScene(geometry)
    return StateModel(geometry, quick.data, quick.plain, quick.correction, only, quick.count)


def scatter_mm(differences: FloatArray, data: DataVector) -> float:
    """Scatter (rms along the surface, mm) of one mesh about the mean of all."""
    if len(differences) < 2:
        return float("nan")
    square = differences[:, : data.n_modes].var(axis=0, ddof=1).sum() / len(data.modes)
    return float(np.sqrt(square))


def fine_element_residual(
    better: StateModel, hypothesis: Hypothesis, linearisation: Linearisation, options: NewtonOptions = OPTIONS
) -> FloatArray | None:
    """Residual (n,) of `fine_solution`."""
    solution = fine_solution(better, hypothesis, linearisation, options)
    return None if solution is None else solution.residual


def fine_solution(
    better: StateModel, hypothesis: Hypothesis, linearisation: Linearisation, options: NewtonOptions = OPTIONS
) -> FineSolution | None:
    """Equilibrium of the better element, started from the quick one's.

    None where it has no equilibrium within what the options allow.
    """
    scene = better.scene_of(hypothesis.composition(better.plain, linearisation.phi))
    state = _started(scene, linearisation)
    for _ in range(_ROUNDS):
        scene.linearise(state.u)
        equilibrium = scene.solve(linearisation.theta, state, options)
        better.count.add(equilibrium)
        if not equilibrium.converged:
            return None
        state = State(equilibrium.u, equilibrium.p)
    return FineSolution(scene, state, better.data.residual(scene, state.u))


def _started(scene: CompositionScene, linearisation: Linearisation) -> State:
    """The quick element's equilibrium on a scene; its pressure unknowns where they are the same (`p2p1`)."""
    u, p = carried(linearisation, scene), linearisation.equilibrium.p
    if len(p) == scene.space.n_pressures:
        return State(u, p)
    scene.assembler.set_materials(scene.materials(linearisation.theta))
    return State(u, scene.assembler.balanced_pressure(u))
