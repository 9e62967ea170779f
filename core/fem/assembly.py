"""Residual and tangent of the equilibrium of a hyperelastic body (Eq 2 of Yang & Lin), mixed or displacement-only.

The functional is  integral W(F) + p g(F) - p^2 / (2 kappa) dV  + terms, stationary in u and p. Eliminating p at fixed u
gives the energy E(u) that a stable equilibrium minimises; the matrix [[K, B], [B', -C]] of the mixed form has the same
Newton step.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem import kernels
from palpate.core.fem.linear.choice import Iterative, Levels, SymmetricSolver, make_solver
from palpate.core.fem.linear.kept_matrix import KeptMatrix
from palpate.core.fem.linear.pattern import Pattern
from palpate.core.fem.materials import Material, MaterialGroup, group_by_law
from palpate.core.fem.pressure_block import PressureBlock
from palpate.core.fem.projection import nearest_positive_semidefinite
from palpate.core.fem.space import Space
from palpate.core.fem.state import Residual, State
from palpate.core.fem.terms.base import Particular, Term
from palpate.core.laws.base import Law
from palpate.core.mesh import TetMesh

_CHUNK = 1024  # quadrature points whose moduli are held at once: they stay in the cache
_REST_STRAIN = 1e-4  # forces are never compared with less than this strain's over the body's section


class Assembler:
    """Assembles one space with its terms and constrained unknowns; materials may change at no symbolic cost.

    free : (3 n,) True for displacement unknowns that are solved for; they lead the kept unknowns. n_free : their
    number. total_volume : mm3. kappa : (m,) kPa of every cell. materials : the last ones given.

    Raises InputError for materials that do not fit the mesh and for loads that have no energy under these constraints.
    """

    def __init__(self, space: Space, free: BoolArray, terms: Sequence[Term] = (), solver: str = "auto") -> None:
        self.space = space
        self.terms = tuple(terms)
        self.free = np.asarray(free, dtype=bool)
        for why in (t.refusal(self.free) for t in self.terms if isinstance(t, Particular)):
            if why is not None:
                raise InputError(why)
        self.n_free = int(self.free.sum())
        self.total_volume = float(space.mesh.volumes.sum())
        e = space.element
        # Component by component, the order of `kernels.tangent_blocks`.
        u_unknowns = (3 * space.cell_nodes[:, None, :] + np.arange(3)[:, None]).reshape(len(space.cell_nodes), -1)
        self._cell_unknowns = np.hstack([u_unknowns, space.n_displacements + space.cell_pressures])
        kept = np.concatenate([self.free, np.ones(space.n_pressures, dtype=bool)])
        number_of = np.where(kept, np.cumsum(kept) - 1, -1)
        self.kept = np.flatnonzero(kept)
        self._terms_unknowns = [t.unknowns for t in self.terms]
        self.pattern = Pattern.of([self._cell_unknowns, *self._terms_unknowns], number_of)
        self.solver: SymmetricSolver = make_solver(self.pattern, solver, _levels(space, self.free))
        self.weight = np.ascontiguousarray(space.mesh.volumes[:, None] * e.weights)
        self.pressures = PressureBlock(space, self.weight, solver)
        self.materials: Mapping[int, Material] = {}
        self.groups: list[MaterialGroup] = []

    def set_materials(self, materials: Mapping[int, Material]) -> None:
        """Take new laws and values, region id -> Material."""
        self.materials = materials
        self.groups = group_by_law(self.space.mesh.regions, materials)
        m = len(self.space.mesh.cells)
        self.kappa, self._shear = np.empty(m), np.empty(m)
        self._guarded = np.zeros(m, dtype=bool)
        for g in self.groups:
            self.kappa[g.cells] = g.law.kappa_of(g.values)
            self._shear[g.cells] = g.law.shear_modulus_of(g.values)
            self._guarded[g.cells] = g.law.needs_positive_jacobian
        # A body at rest has no forces to compare with; rounding in terms must not count as out-of-balance there.
        self._least_force = _REST_STRAIN * float(self._shear.mean()) * self.total_volume ** (2.0 / 3.0)
        self.pressures.set_moduli(self.kappa, self._shear)
        if isinstance(self.solver, Iterative):
            self.solver.schur = self.pressures.schur

    @property
    def cell_size(self) -> float:
        """Edge of a regular tetrahedron of the mean volume, mm."""
        return float((6.0 * np.sqrt(2.0) * self.total_volume / len(self.space.mesh.cells)) ** (1.0 / 3.0))

    def deformation_gradients(self, u: FloatArray) -> FloatArray:
        """(m, q, 3, 3)."""
        F = np.empty((*self.weight.shape, 3, 3))
        kernels.deformation_gradients(u, self.space.cell_nodes, self.space.element.dN, self.space.inverse_jacobians, F)
        return F

    def min_jacobian(self, u: FloatArray) -> float:
        """Smallest det F over the cells whose law needs it positive."""
        return float(kernels.smallest_determinant(self.deformation_gradients(u), self._guarded))

    def balanced_pressure(self, u: FloatArray) -> FloatArray:
        """p(u) that makes the functional stationary in p, (n_p,) kPa."""
        F = self.deformation_gradients(u)
        b = np.zeros(self.space.n_pressures)
        for g in self.groups if self.pressures.exists else ():
            self.pressures.add_volume_change(g.law.evaluate(F[g.cells], g.values, 0).g, g.cells, b)
        return self.pressures.solve(b)

    def energy(self, u: FloatArray, load: float) -> float:
        """E(u) mN mm, pressure eliminated; +inf where a law is not defined."""
        F = self.deformation_gradients(u)
        if not kernels.smallest_determinant(F, self._guarded) > 0.0:
            return np.inf
        total = sum(t.evaluate(u, load, 0)[0] for t in self.terms)
        b = np.zeros(self.space.n_pressures)
        for g in self.groups:
            v = g.law.evaluate(F[g.cells], g.values, 0)
            total += float((self.weight[g.cells] * v.W).sum())
            if self.pressures.exists:
                self.pressures.add_volume_change(v.g, g.cells, b)
            else:
                total += 0.5 * float((self.weight[g.cells] * self.kappa[g.cells, None] * v.g**2).sum())
        if self.pressures.exists:
            total += 0.5 * float(b @ self.pressures.solve(b))
        return float(total)

    def residual(self, state: State, load: float, slopes: FloatArray | None = None) -> Residual:
        """Out-of-balance of a state under a fraction of the load. slopes : `pressure_slopes` of the factor, for a state
        with q.
        """
        F = self.deformation_gradients(state.u)
        r_u, scale = np.zeros_like(state.u), np.zeros_like(state.u)
        b = np.zeros(self.space.n_pressures)
        lag = None if state.q is None or slopes is None else np.empty_like(state.q)
        for g in self.groups:
            v = g.law.evaluate(F[g.cells], g.values, 1)
            if state.q is None or lag is None or slopes is None:
                kernels.add_pressure(self._pressures(state.p, v.g, g.cells), v.G, v.P)
            else:
                q = state.q[g.cells]
                lag[g.cells] = self.kappa[g.cells, None] * v.g - q
                kernels.add_pressure(q, v.G, v.P)
                kernels.add_pressure(lag[g.cells], slopes[g.cells], v.P)
            self.add_internal_force(v.P, g.cells, r_u, scale)
            self.pressures.add_volume_change(v.g, g.cells, b)
        r = r_u.reshape(-1)
        for term, unknowns in zip(self.terms, self._terms_unknowns, strict=True):
            np.add.at(r, unknowns, term.evaluate(state.u, load, 1)[1])
        low = float(kernels.smallest_determinant(F, self._guarded))
        size = max(float(np.sqrt((scale**2).sum())), self._least_force)
        return Residual(r, b - self.pressures.apply(state.p), size, low, lag)

    def internal_residual_on(self, points: FloatArray, state: State) -> FloatArray:
        """Residual (kept,), forces mN and volumes mm3, of the cells alone, without terms, at a state on a mesh whose points
        (vertices, 3) mm lie elsewhere. The cells keep their materials."""
        mesh = TetMesh(points, self.space.mesh.cells, self.space.mesh.regions)
        space = replace(self.space, mesh=mesh, nodes=points)  # mid-edge nodes are not read: cells are straight-sided
        out = copy.copy(self)
        out.space, out.terms, out._terms_unknowns = space, (), []
        out.weight = np.ascontiguousarray(mesh.volumes[:, None] * space.element.weights)
        out.pressures = self.pressures.unfactorised_on(space, out.weight, self.kappa, self._shear)
        found = out.residual(state, 1.0)
        return np.concatenate([found.r_u, found.r_p])[self.kept]

    def tangent(
        self, state: State, load: float, along: FloatArray | None = None, project: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Upper-triangle values of the kept matrix and its product (kept,) with `along` (3 n,), the move of constrained
        unknowns.

        project : replace each point's d2psi/dFdF and each term's stiffness by the nearest positive semi-definite one,
        which makes the step a descent direction of the energy (Teran et al. 2005).
        """
        F = self.deformation_gradients(state.u)
        matrix = KeptMatrix(self.pattern, self.space.n_displacements + self.space.n_pressures, along)
        chunk = max(1, _CHUNK // self.weight.shape[1])
        workspace = np.empty((chunk, self._cell_unknowns.shape[1], self._cell_unknowns.shape[1]))
        for g in self.groups:
            for start in range(0, len(g.cells), chunk):
                part = slice(start, start + chunk)
                blocks = workspace[: len(g.cells[part])]
                self._fill_blocks(F, g.law, g.cells[part], g.values[part], state, project, blocks)
                matrix.add(0, blocks, g.cells[part], self._cell_unknowns)
        for k, term in enumerate(self.terms):
            blocks = term.evaluate(state.u, load, 2)[2]
            if project:
                blocks = nearest_positive_semidefinite(blocks)
            matrix.add(k + 1, blocks, np.arange(len(blocks)), self._terms_unknowns[k])
        return matrix.values, matrix.product[self.kept]

    def _pressures(self, p: FloatArray, g: FloatArray, cells: IntArray) -> FloatArray:
        """Pressure (m, q) at the points: interpolated, or kappa g without pressure unknowns."""
        if self.pressures.exists:
            return self.pressures.at_points(p, cells, np.empty_like(g))
        return self.kappa[cells, None] * g

    def _fill_blocks(
        self,
        F: FloatArray,
        law: Law,
        cells: IntArray,
        values: FloatArray,
        state: State,
        project: bool,
        out: FloatArray,
    ) -> None:
        """Upper triangles of the cells' dense blocks into out (cells, d, d)."""
        e = self.space.element
        v = law.evaluate(F[cells], values, 2)
        curvature = np.zeros(len(cells)) if self.pressures.exists else self.kappa[cells]
        pressures = self._pressures(state.p, v.g, cells) if state.q is None else state.q[cells]
        kernels.complete_moduli(v.A, v.H, v.G, pressures, curvature)
        A = nearest_positive_semidefinite(v.A) if project else v.A
        inverse = self.space.inverse_jacobians
        kernels.tangent_blocks(A, v.G, e.Np, e.dN, inverse, self.weight, cells, self.pressures.compliance, out)

    def add_internal_force(self, stress: FloatArray, cells: IntArray, out: FloatArray, scale: FloatArray) -> None:
        """Adds what stress (k, q, 3, 3) kPa in `cells` pulls on nodes to out (n, 3) mN, and its size to scale (n,
        3).
        """
        space = self.space
        kernels.add_internal_force(
            stress, cells, space.cell_nodes, space.element.dN, space.inverse_jacobians, self.weight, out, scale
        )


def _levels(space: Space, free: BoolArray) -> Levels | None:
    """How quadratic displacements go with linear ones; None for elements that the iterative solver does not serve."""
    if space.element.degree != 2 or space.element.pressure != "vertex":
        return None
    return Levels.of(free, len(space.mesh.points), space.edge_ends)
