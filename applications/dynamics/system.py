"""A body in motion: its assembler, mass, gravity, damping and contact, and the potential that one implicit stage
minimises.

A stage of backward Euler or of a diagonally implicit Runge-Kutta method is the minimum of (Kane et al. 2000, Int. J.
Numer. Meth. Engng 49:1295; Li et al. 2020, Incremental potential contact)

    J(U) = |U - aim|^2_M / (2 h^2) + elastic + gravity + contact + h dissipation((U - base) / h).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.applications.dynamics.contact import Contact, Friction
from palpate.applications.dynamics.mass import Mass
from palpate.applications.dynamics.motion import Energies, Motion, Stage
from palpate.applications.dynamics.viscosity import Viscosity
from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.linear.pardiso import symmetric_product
from palpate.core.fem.linear.pattern import scatter
from palpate.core.fem.state import State


class MovingBody:
    """A body whose materials are set on its assembler before.

    density : kg/mm3, one or one a region. gravity : (3,) mm/s2. damping : s, see `viscosity`. contact : with rigid
    bodies. Unknowns that the assembler does not hold free stay where they are.
    """

    def __init__(
        self,
        assembler: Assembler,
        density: float | Mapping[int, float],
        gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        damping: float = 0.0,
        contact: Contact | None = None,
    ) -> None:
        self.assembler, self.contact = assembler, contact
        self.mass = Mass.of(assembler.space, density)
        self.weight = self.mass.times(np.broadcast_to(np.asarray(gravity, dtype=float), assembler.space.nodes.shape))
        self.viscosity = Viscosity(assembler, damping) if damping > 0.0 else None
        self._mass_values = self._spread_mass()
        number_of = np.full(assembler.space.n_displacements + assembler.space.n_pressures, -1)
        number_of[assembler.kept] = np.arange(len(assembler.kept))
        self._number_of = number_of[: assembler.space.n_displacements]
        indptr, indices = assembler.pattern.indptr, assembler.pattern.indices
        rows = np.repeat(np.arange(assembler.pattern.n, dtype=np.int64), np.diff(indptr))
        self._keys = rows * assembler.pattern.n + indices

    def at_rest(self) -> Motion:
        """No displacement, no velocity."""
        nothing = np.zeros((self.assembler.space.n_nodes, 3))
        return Motion(0.0, nothing, nothing.copy())

    # Quantities of a motion

    def energies(self, motion: Motion, load: float = 1.0) -> Energies:
        """Energies of a motion under a fraction of the load of the assembler's terms."""
        return Energies(
            kinetic=0.5 * float((motion.v * self.mass.times(motion.v)).sum()),
            elastic=self.assembler.energy(motion.u, load),
            gravity=-float((self.weight * motion.u).sum()),
            contact=0.0 if self.contact is None else self.contact.energy(motion.u),
        )

    def momentum(self, motion: Motion) -> FloatArray:
        """(3,) kg mm/s = mN s."""
        return np.asarray(self.mass.times(motion.v).sum(axis=0))

    def centre(self, motion: Motion) -> FloatArray:
        """(3,) mm, centre of mass."""
        return np.asarray(self.mass.times(self.assembler.space.nodes + motion.u).sum(axis=0)) / self.mass.total

    # Quantities of one stage

    def friction(self, stage: Stage) -> Friction | None:
        """Friction of a stage with the normal forces of where it was taken; None without."""
        if self.contact is None or stage.friction_from is None:
            return None
        return self.contact.friction_at(stage.friction_from)

    def potential(self, stage: Stage, friction: Friction | None, u: FloatArray) -> float:
        """J(U) mN mm; +inf where a law is not defined or a wall is crossed."""
        d = u - stage.aim
        total = 0.5 * float((d * self.mass.times(d)).sum()) / stage.h**2 - float((self.weight * u).sum())
        if self.contact is not None:
            total += self.contact.energy(u)
        if stage.damping is not None:
            total += 0.5 * float(((u - stage.base) * self.damping_force(stage, u)).sum())
        if friction is not None:
            total += stage.h * friction.potential((u - stage.base) / stage.h)
        return total + self.assembler.energy(u, stage.load)

    def gradient(self, stage: Stage, friction: Friction | None, u: FloatArray) -> FloatArray:
        """dJ/dU (n, 3) mN without the elastic part, which the assembler gives."""
        g = self.mass.times(u - stage.aim) / stage.h**2 - self.weight
        if self.contact is not None:
            g += self.contact.gradient(u)
        if stage.damping is not None:
            g += self.damping_force(stage, u)
        if friction is not None:
            g += friction.gradient((u - stage.base) / stage.h)
        return g

    def curvature(self, stage: Stage, friction: Friction | None, u: FloatArray) -> FloatArray:
        """d2J/dU2 without the elastic part, upper triangle (nnz,) of the kept unknowns; contact and friction made
        semi-definite.
        """
        values = self._mass_values / stage.h**2
        if stage.damping is not None:
            values += stage.damping / stage.h
        if self.contact is not None:
            self._add(*self.contact.hessian(u), 1.0, values)
        if friction is not None:
            self._add(*friction.hessian((u - stage.base) / stage.h), 1.0 / stage.h, values)
        return values

    def elastic_force(self, u: FloatArray, load: float) -> tuple[State, FloatArray]:
        """The state with its balanced pressure, and the internal forces (n, 3) mN with those of the assembler's
        terms.
        """
        state = State(u, self.assembler.balanced_pressure(u))
        return state, self.assembler.residual(state, load).r_u.reshape(-1, 3)

    def damping_force(self, stage: Stage, u: FloatArray) -> FloatArray:
        """(n, 3) mN, against the motion from the stage's base to u; zero for a body without damping."""
        if stage.damping is None:
            return np.zeros_like(u)
        pattern, kept = self.assembler.pattern, self.assembler.kept
        rate = np.zeros(pattern.n)
        rate[: self.assembler.n_free] = ((u - stage.base) / stage.h).reshape(-1)[self.assembler.free]
        product = symmetric_product(pattern.indptr, pattern.indices, stage.damping, rate[None])[0]
        out = np.zeros(u.size)
        out[kept[: self.assembler.n_free]] = product[: self.assembler.n_free]
        return out.reshape(u.shape)

    def _spread_mass(self) -> FloatArray:
        a, (m, k) = self.assembler, self.mass.cells.shape[:2]
        d = 3 * k + a.space.element.n_pressures
        blocks = np.zeros((m, d, d))
        for i in range(3):
            blocks[:, i * k : (i + 1) * k, i * k : (i + 1) * k] = self.mass.cells
        values = np.zeros(len(a.pattern.indices))
        scatter(blocks, a.pattern.slots[0], values)
        return values

    def _add(
        self,
        rows: IntArray,
        columns: IntArray,
        entries: FloatArray,
        factor: float,
        values: FloatArray,
    ) -> None:
        """Adds entries of a symmetric matrix over displacement unknowns to the upper triangle of the kept ones.

        Contact of single nodes with what does not move couples no two nodes, so that every entry has its place already.
        """
        r, c = self._number_of[rows], self._number_of[columns]
        upper = (r >= 0) & (c >= r)
        np.add.at(
            values, np.searchsorted(self._keys, r[upper] * self.assembler.pattern.n + c[upper]), factor * entries[upper]
        )
