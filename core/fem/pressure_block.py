"""The pressure unknowns of a mixed element: the rows B' and C of [[K, B], [B', -C]], C with its factor."""

from __future__ import annotations

import copy

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem import kernels
from palpate.core.fem.linear.direct import make_direct
from palpate.core.fem.linear.direct_solver import SymmetricSolver
from palpate.core.fem.linear.pattern import Pattern, scatter
from palpate.core.fem.space import Space

# alpha of p1p1. Dohrmann & Bochev take 1; on the sphere in a cube 4 errs a third less at every size, drive and bulk
# modulus (5.3 to 3.7 % at 3,840 cells by traction), because it gives back some of what linear displacements lock in
# shear; 20 is too soft.
STABILISATION = 4.0


class PressureBlock:
    """Pressures of one space; all sums are empty where its element has none (`exists` False).

    weight : (m, points) mm3. compliance : (m, k, k) mm3/kPa, the cells' share of C: mass over the bulk modulus and the
    stabilisation over the shear modulus.
    """

    def __init__(self, space: Space, weight: FloatArray, solver: str) -> None:
        self._take(space, weight)
        self._solver_name = "auto" if solver == "iterative" else solver
        self.exists = space.n_pressures > 0
        self._solver: SymmetricSolver | None = None
        self._schur: SymmetricSolver | None = None
        self._factorised = False
        if self.exists:
            self._pattern = Pattern.of([space.cell_pressures], np.arange(space.n_pressures))
            self._solver = make_direct(self._pattern, self._solver_name)

    def on_shape(self, space: Space, weight: FloatArray) -> PressureBlock:
        """Block of the same unknowns on a mesh with the same cells and other points: its own sums and factor, this one's structure.

        Moduli are to be set before use.
        """
        out = copy.copy(self)
        out._take(space, weight)
        if self.exists:
            out._solver, out._schur = make_direct(self._pattern, self._solver_name), None
        return out

    def set_moduli(self, kappa: FloatArray, shear: FloatArray) -> None:
        """Bulk and shear modulus at rest (m,) kPa of every cell."""
        if self._solver is None:
            return
        self.compliance = self._compliance_of(kappa, shear)
        self._shear, self._schur, self._factorised = shear, None, False

    def unfactorised_on(self, space: Space, weight: FloatArray, kappa: FloatArray, shear: FloatArray) -> PressureBlock:
        """Block on another shape with these moduli, which applies C and does not solve with it."""
        out = copy.copy(self)
        out._take(space, weight)
        out._solver = out._schur = None
        if self.exists:
            out.compliance = out._compliance_of(kappa, shear)
        return out

    def _compliance_of(self, kappa: FloatArray, shear: FloatArray) -> FloatArray:
        e, volumes = self.space.element, self.space.mesh.volumes
        mass = (volumes / kappa)[:, None, None] * e.mass
        return np.asarray(mass + (STABILISATION * volumes / shear)[:, None, None] * e.stabilisation)

    def _take(self, space: Space, weight: FloatArray) -> None:
        self.space, self._weight = space, weight
        self.compliance = np.zeros((len(space.mesh.cells), 0, 0))

    def solve(self, b: FloatArray) -> FloatArray:
        """C^-1 b (n_p,)."""
        if self._solver is None:
            return np.zeros(0)
        if not self._factorised:  # here: what is only linearised needs no factor
            values = np.zeros(len(self._pattern.indices))
            scatter(self.compliance, self._pattern.slots[0], values)
            self._solver.factorise(values)
            self._factorised = True
        return self._solver.solve(b)

    def schur(self, b: FloatArray) -> FloatArray:
        """About (C + B' K^-1 B)^-1 b (n_p,): B' K^-1 B acts as the mass over 4/3 G, K's modulus against a change of volume."""
        if self._schur is None:
            e, values = self.space.element, np.zeros(len(self._pattern.indices))
            softness = (0.75 * self.space.mesh.volumes / self._shear)[:, None, None] * e.mass
            scatter(self.compliance + softness, self._pattern.slots[0], values)
            self._schur = make_direct(self._pattern, self._solver_name)
            self._schur.factorise(values)
        return self._schur.solve_roughly(b)

    def apply(self, p: FloatArray) -> FloatArray:
        """C p (n_p,) mm3."""
        out = np.zeros(self.space.n_pressures)
        if self.exists:
            dofs = self.space.cell_pressures
            np.add.at(out, dofs, np.einsum("eij,ej->ei", self.compliance, p[dofs]))
        return out

    def add_rate(
        self,
        cells: IntArray,
        kappa: tuple[FloatArray, FloatArray],
        shear: tuple[FloatArray, FloatArray],
        p: FloatArray,
        out: FloatArray,
    ) -> None:
        """Add -(dC/dtheta) p to out (n_p,); kappa and shear are (value, rate) at `cells`."""
        e, volumes = self.space.element, self.space.mesh.volumes[cells]
        rate = (volumes * kappa[1] / kappa[0] ** 2)[:, None, None] * e.mass
        rate = rate + (STABILISATION * volumes * shear[1] / shear[0] ** 2)[:, None, None] * e.stabilisation
        dofs = self.space.cell_pressures[cells]
        np.add.at(out, dofs, np.einsum("eij,ej->ei", rate, p[dofs]))

    def at_points(self, p: FloatArray, cells: IntArray, out: FloatArray) -> FloatArray:
        """Pressures p (n_p,) interpolated to the points of `cells`, into out (cells, points)."""
        kernels.pressure_at_points(p, cells, self.space.element.Np, self.space.cell_pressures, out)
        return out

    def add_volume_change(self, g: FloatArray, cells: IntArray, out: FloatArray) -> None:
        """Add the integrals of Np g, g (cells, points) the law's volume change, to out (n_p,) mm3."""
        if self.exists:
            kernels.add_volumetric_force(g, cells, self.space.element.Np, self.space.cell_pressures, self._weight, out)
