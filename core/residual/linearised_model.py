"""Linearised model of one deformed state: equilibrium, residual, and derivatives in the stiffness and in an effect."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.state import State
from palpate.core.fem.tangent import Tangent
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.effect import Effect, Variant
from palpate.core.forward.scene_parts import prolonged
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_correction import ElementCorrection

# Rounds in which walls find their place: from rest, and from a neighbour's equilibrium.
_FROM_AFAR, _FROM_NEARBY = 8, 2
# Step of phi's finite differences, in prior standard deviations.
_STEP = 1e-3
# Share of such a step at which an opened interface still counts as tied.
_TIED = 1e-6


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Variant of an effect under test; None, None stands for the plain model."""

    effect: Effect | None = None
    variant: Variant | None = None

    @property
    def n(self) -> int:
        """Number of the effect's parameters."""
        return 0 if self.effect is None else len(self.effect.parameters)

    def composition(self, plain: Composition, phi: FloatArray) -> Composition:
        """Composition at phi (n,)."""
        return plain if self.variant is None else self.variant.applied(plain, phi)


PLAIN = Hypothesis()
NOTHING = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Linearisation:
    """A model solved in one deformed state, and linearised there.

    residual (n,) : with the better element's correction. in_theta (n, t) : its derivative in ln G, likewise. out_of_balance
    (kept,) : residual forces at the end of Newton's iteration.
    """

    theta: FloatArray
    phi: FloatArray
    scene: CompositionScene
    equilibrium: Equilibrium
    residual: FloatArray
    in_theta: FloatArray
    out_of_balance: FloatArray

    @property
    def tangent(self) -> Tangent:
        """The scene's tangent at the equilibrium, with its factor."""
        return self.equilibrium.tangent


@dataclass
class SolveCount:
    """Work done so far. solves : equilibria. factorisations : of the tangent. failed : solves without an equilibrium."""

    solves: int = 0
    factorisations: int = 0
    failed: int = 0

    def add(self, equilibrium: Equilibrium) -> None:
        """Count one equilibrium."""
        self.solves += 1
        self.factorisations += equilibrium.factorisations
        self.failed += 0 if equilibrium.converged else 1

    def include(self, other: SolveCount) -> None:
        """Count what another has counted too."""
        self.solves += other.solves
        self.factorisations += other.factorisations
        self.failed += other.failed


@dataclass(eq=False)
class StateModel:
    """Model of one deformed state, to be solved for any hypothesis.

    plain : the composition without an effect. correction : what the better element adds to every residual. only : the one
    scene that there is on a boundary that takes no composition (`contact-force`), None otherwise.
    """

    geometry: SharedGeometry
    data: DataVector
    plain: Composition
    correction: ElementCorrection
    only: CompositionScene | None = None
    count: SolveCount = field(default_factory=SolveCount)

    def scene_of(self, composition: Composition) -> CompositionScene:
        """Scene of a composition. Raises InputError for a stress-free mesh that is turned inside out."""
        return CompositionScene(self.geometry, composition) if self.only is None else self.only

    def _unfolded(self, composition: Composition) -> CompositionScene | None:
        """Scene of a composition; None for a stress-free mesh that is turned inside out."""
        try:
            return self.scene_of(composition)
        except InputError:
            return None

    def solve(
        self, hypothesis: Hypothesis, theta: FloatArray, phi: FloatArray, near: Linearisation | None
    ) -> Linearisation | None:
        """The model at (theta, phi), started from the equilibrium of `near`; None when it has none."""
        scene = self._unfolded(hypothesis.composition(self.plain, phi))
        if scene is None:
            return None
        u = None if near is None else carried(near, scene)
        start = None
        if u is not None:
            scene.assembler.set_materials(scene.materials(theta))
            start = State(u, scene.assembler.balanced_pressure(u))
        settled = scene.settle(theta, start, rounds=_FROM_AFAR if near is None else _FROM_NEARBY)
        equilibrium = settled.equilibrium
        self.count.add(equilibrium)
        if not equilibrium.converged:
            return None
        residual = self.data.residual(scene, equilibrium.u) + self.correction.at(theta)
        sensitivities = scene.displacement_sensitivities(theta, equilibrium)
        in_theta = self.data.in_theta(scene, theta, equilibrium, sensitivities) + self.correction.in_theta(theta)
        imbalance = out_of_balance(scene.assembler, State(equilibrium.u, equilibrium.p))
        return Linearisation(theta, phi, scene, equilibrium, residual, in_theta, imbalance)

    def directions(self, hypothesis: Hypothesis, at: Linearisation) -> FloatArray:
        """Derivative (n, k) of the residual in phi: one back-substitution per parameter with the linearisation's own
        tangent. None along a parameter whose every step turns a cell of the stress-free mesh inside out."""
        assert hypothesis.effect is not None
        columns = []
        here = np.array([p.state in (None, self.plain.state) for p in hypothesis.effect.parameters])
        for j, parameter in enumerate(hypothesis.effect.parameters):
            if not here[j] or (parameter.secondary and not at.phi[here].any()):
                columns.append(np.zeros(self.data.n))
                continue
            step = np.zeros(hypothesis.n)
            step[j] = _STEP * parameter.scale * (-1.0 if at.phi[j] + _STEP * parameter.scale > parameter.high else 1.0)
            columns.append(self._slope(hypothesis, at, step, step[j]))
        return np.stack(columns, axis=1)

    def _slope(self, hypothesis: Hypothesis, at: Linearisation, step: FloatArray, length: float) -> FloatArray:
        """Slope (n,) of the residual along a step (k,) of phi, or against it where the mesh folds that way."""
        for sign in (1.0, -1.0):
            change = self._difference(hypothesis, at, sign * step)
            if change is not None:
                return np.asarray(change / (sign * length))
        return np.zeros(self.data.n)

    def _difference(self, hypothesis: Hypothesis, at: Linearisation, step: FloatArray) -> FloatArray | None:
        """Change (n,) of the residual from phi to phi + step, to first order; None where the stress-free mesh folds there."""
        if hypothesis.composition(self.plain, at.phi + step) is at.scene.composition:
            return np.zeros(self.data.n)
        scene = self._unfolded(hypothesis.composition(self.plain, at.phi + step))
        if scene is None:
            return None
        u = carried(at, scene)
        scene.linearise(carried_nodes(at, scene, at.scene.linearised_at))
        moved = newton_step(at, scene, u)
        after = self.data.residual(scene, u + moved) + self.correction.at(at.theta)
        if scene.space.n_nodes == at.scene.space.n_nodes:
            return after - at.residual
        # Cutting the mesh open moves it a little by itself: count from the cut mesh held together.
        scene = CompositionScene(self.geometry, hypothesis.composition(self.plain, at.phi + _TIED * step))
        scene.linearise(carried_nodes(at, scene, at.scene.linearised_at))
        return after - self.data.residual(scene, u + newton_step(at, scene, u)) - self.correction.at(at.theta)


def carried(at: Linearisation, scene: CompositionScene) -> FloatArray:
    """Displacements (nodes, 3) mm of another scene that put its nodes where the linearisation's are."""
    return carried_nodes(at, scene, at.equilibrium.u)


def carried_nodes(at: Linearisation, scene: CompositionScene, u: FloatArray) -> FloatArray:
    """The same for any displacement u (n, 3) mm of the linearisation's scene; mid-edge nodes take the mean of their
    ends."""
    place = u + at.scene.shift
    if scene.space.element.degree != at.scene.space.element.degree:
        place = prolonged(place, scene.space)
    if len(place) != scene.space.n_nodes:
        cut = scene.geometry.cut
        if len(place) < scene.space.n_nodes:
            place = place[cut.original]
        else:
            place = place[: scene.space.n_nodes]
    out: FloatArray = place - scene.shift
    return out


def newton_step(at: Linearisation, scene: CompositionScene, u: FloatArray) -> FloatArray:
    """First-order change (nodes, 3) mm of the equilibrium when the linearisation's model becomes the scene's.

    Where the unknowns are the same, the linearisation's tangent serves; a model with other unknowns is factorised once.
    """
    there = scene.assembler
    n = there.space.n_displacements
    held = (scene.prescribed - u.ravel()) * ~there.free
    state = State(u, at.equilibrium.p)
    there.set_materials(scene.materials(at.theta))
    there.terms = scene.terms
    force = out_of_balance(there, state)
    if there.space.n_nodes == at.scene.space.n_nodes:
        if held.any():
            force = force + there.tangent(state, 1.0, held)[1]
        step = -at.tangent.solve(force - at.out_of_balance)
    else:
        values, product = there.tangent(state, 1.0, held)
        there.solver.factorise(values)
        step = -there.solver.solve(force + product)
    full = np.zeros(n + there.space.n_pressures)
    full[there.kept] = step
    return (full[:n] + held).reshape(-1, 3)


def out_of_balance(assembler: Assembler, state: State) -> FloatArray:
    """Residual forces (kept,) of an assembler with its present materials and terms."""
    r = assembler.residual(state, 1.0)
    return np.concatenate([r.r_u, r.r_p])[assembler.kept]
