"""Composition of a body in one of its states, ready to be solved, and the markers' predicted motion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.diagnose.bench_bodies.problem import BodyProblem, BodyState
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.fem.assembly import Assembler, State
from palpate.core.fem.newton.newton import Equilibrium, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.loads import PointForce, body_force
from palpate.core.forward.composition import Composition
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.forward.scene_parts import dead_load
from palpate.core.residual.linearised_model import out_of_balance

ELEMENT = "p2p1"
# A marker off the body moves rigidly with the material within this distance of the body's point nearest to it, mm.
HOLDER_MM = 12.0
# A point load spreads over the surface with this standard deviation, mm.
_PATCH_MM = 4.0
_MN = 1000.0  # mN in a N


@dataclass(eq=False)
class BodySolver:
    """Solver that all models of one body share: space, matrix structure, last equilibrium of each state.

    held : nodes that supports hold. last : displacements (n, 3) mm by the state's name, the start of its next solve.
    """

    problem: BodyProblem
    space: Space
    assembler: Assembler
    held: IntArray
    options: DiagnosisOptions
    last: dict[str, FloatArray] = field(default_factory=dict)

    @classmethod
    def of(cls, problem: BodyProblem, options: DiagnosisOptions | None = None) -> BodySolver:
        """Solver with the program's own numbers where no options are given.

        Raises InputError when nothing holds the body.
        """
        space = Space.of(problem.mesh, ELEMENT)
        held = np.unique(space.face_nodes(problem.held))
        free = np.ones((space.n_nodes, 3), dtype=bool)
        free[held] = False
        return cls(
            problem, space, Assembler(space, free.ravel(), (dead_load(space, []),)), held, options or DiagnosisOptions()
        )

    def solve(self, composition: Composition, theta: FloatArray, state: BodyState) -> Equilibrium:
        """Equilibrium of a composition at ln G = theta (1,) in one state; `converged` is false where there is none."""
        prescribed = self._pose(composition, theta, state)
        equilibrium = solve_equilibrium(self.assembler, None, prescribed.ravel(), self.last.get(state.name))
        if equilibrium.converged:
            self.last[state.name] = equilibrium.u
        return equilibrium

    def first_order(
        self, composition: Composition, theta: FloatArray, state: BodyState, at: Equilibrium, balance: FloatArray
    ) -> FloatArray:
        """First-order change (n, 3) mm of the equilibrium when the model becomes this one: one back-substitution.

        at : the equilibrium; balance : `out_of_balance` there.
        """
        prescribed = self._pose(composition, theta, state)
        held = (prescribed - at.u).ravel() * ~self.assembler.free
        here = State(at.u, at.p)
        force = out_of_balance(self.assembler, here) - balance
        if held.any():
            force = force + self.assembler.tangent(here, 1.0, held)[1]
        full = np.zeros(self.space.n_displacements + self.space.n_pressures)
        full[self.assembler.kept] = -at.tangent.solve(force)
        return np.asarray((full[: self.space.n_displacements] + held).reshape(-1, 3))

    def _pose(self, composition: Composition, theta: FloatArray, state: BodyState) -> FloatArray:
        """Prescribed displacements (n, 3) mm; sets the assembler's materials and loads to the model's."""
        loads: list[Term] = [_force(self.space, load.at, load.force_n) for load in state.loads]
        if self.problem.model_gravity:
            b = 1e-6 * self.problem.density_kg_m3 * np.array(state.gravity)  # 1 kg/m3 m/s2 is 1e-6 kPa/mm
            loads.append(body_force(self.space, b))
        loads += [make(self.space) for make in composition.load]
        self.assembler.terms = (dead_load(self.space, loads),)
        plain = StiffnessParameters(self.problem.shell.regions, self.problem.shell.facts).materials(theta)
        self.assembler.set_materials(composition.materials(plain))
        prescribed = np.zeros((self.space.n_nodes, 3))
        if composition.support:
            prescribed[self.held] = composition.bone_motion(self.space.nodes[self.held])
        return prescribed

    def markers(self, u: FloatArray, state: BodyState) -> FloatArray:
        """Motion (k, 3) mm of a state's markers for nodal displacements u (n, 3) mm."""
        return np.array([_carried(self.space.nodes, u, np.array(x)) for x in state.rest])


def _carried(nodes: FloatArray, u: FloatArray, x: FloatArray) -> FloatArray:
    """Motion (3,) mm of a point x (3,) mm fixed to the material around its nearest node: a rigid fit (Kabsch 1976)."""
    tree = cKDTree(nodes)
    near = tree.query_ball_point(nodes[tree.query(x)[1]], HOLDER_MM)
    before, after = nodes[near], nodes[near] + u[near]
    U, _, Vt = np.linalg.svd((before - before.mean(axis=0)).T @ (after - after.mean(axis=0)))
    R = (U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt).T
    return np.asarray(after.mean(axis=0) + R @ (x - before.mean(axis=0)) - x)


def _force(space: Space, at: tuple[float, ...], newton: tuple[float, ...]) -> PointForce:
    """A force (N) on the surface around the point nearest to `at`."""
    surface = np.unique(space.face_nodes(space.mesh.region_boundary((1,))[0]))
    X = space.nodes[surface]
    nearest = X[int(np.argmin(np.linalg.norm(X - np.array(at), axis=1)))]
    weight = np.exp(-0.5 * ((X - nearest) ** 2).sum(axis=1) / _PATCH_MM**2)
    force = np.zeros((space.n_nodes, 3))
    force[surface] = (weight / weight.sum())[:, None] * _MN * np.array(newton)
    return PointForce(dead_load(space, []).points, force)
