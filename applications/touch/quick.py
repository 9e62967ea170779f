"""The quick solver: equilibrium of a touched body in some milliseconds, with an estimate of its error.

Computed once, at rest: the factor of the tangent, and the compliance of the surface under unit forces on every node
(Green's functions). Each round solves the contact of that linear body exactly, as a small dense problem of the nodes
near the probe. The residual of the nonlinear cells is then corrected with the same factor, a few times, with Anderson
mixing. Error estimate of the force: the last step of the nodes relative to their whole motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.applications.touch.body import Body
from palpate.applications.touch.patch import Patch
from palpate.applications.touch.probe import Contact
from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.work import moved
from palpate.core.fem.state import State

# Tolerance of the patch's contact in each round, relative to an edge.
_PRECISION = 2e-5
# Force, mN, below which its error does not count.
_NOTHING = 0.05
# Changes that the mixing looks back on.
_HISTORY = 6


@dataclass(frozen=True)
class QuickOptions:
    """tolerance : of the force, relative, by its own estimate. iterations : at most.

    safety : factor on the estimate. The relative error of the force is 0.2 to 0.4 times the last step of the touched
    nodes relative to their whole motion, at most 1.13 times (measured on 120 touches with three supports).
    """

    tolerance: float = 8e-3
    iterations: int = 14
    safety: float = 1.2


@dataclass(frozen=True, eq=False)
class QuickAnswer:
    """state : displacements and pressures. force : (3,) mN on the probe.

    estimate : mN, of the force's error; infinite where the iteration diverged. good : whether it meets the tolerance.
    iterations : rounds.
    """

    state: State
    force: FloatArray
    estimate: float
    good: bool
    iterations: int


class QuickTouch:
    """One body prepared at rest; preparation takes one to two seconds for 4,000 cells."""

    def __init__(self, body: Body, options: QuickOptions | None = None, solver: str = "auto") -> None:
        self.body = body
        self.options = options or QuickOptions()
        self.assembler = body.assembler(solver=solver)
        space = body.space
        self.at_rest = State(np.zeros((space.n_nodes, 3)), np.zeros(space.n_pressures))
        values, _ = self.assembler.tangent(self.at_rest, 1.0)
        self.assembler.solver.factorise(values)
        free = np.full(space.n_displacements, -1)
        free[self.assembler.kept[: self.assembler.n_free]] = np.arange(self.assembler.n_free)
        # Of the surface's degrees of freedom (3 s,): where they stand among the kept unknowns, and 0 for those that are
        # held.
        self._row = free[(3 * body.surface.nodes[:, None] + np.arange(3)).ravel()]
        self._moves = (self._row >= 0).astype(float)
        self._responses = self._unit_responses()
        self._compliance = np.ascontiguousarray(self._responses[:, self._row] * self._moves)

    def answer(self, contact: Contact, start: State | None = None) -> QuickAnswer:
        """Equilibrium under the probe, from a neighbour's state or from rest."""
        surface = self.body.surface
        untouched = contact.blocks(np.arange(len(surface.faces)), np.zeros((len(surface.nodes), 3)), 1)
        if not untouched.gradient.any():  # nothing moves a body that nothing touches
            return QuickAnswer(self.at_rest, np.zeros(3), 0.0, True, 0)
        state, mixing = start or self.at_rest, Mixing(self.assembler.n_free)
        f, force, estimate = np.zeros(len(self._row)), np.zeros(3), np.inf
        for k in range(1, self.options.iterations + 1):
            free = self._relaxed(state)
            if free is None:
                return QuickAnswer(state, force, np.inf, False, k)
            step, f, force = self._touched(contact, state, free, f)
            share, size = self.options.safety * self._still_to_move(state, step, f), float(np.linalg.norm(force))
            estimate = share * size if size > 0.0 else np.inf
            if size > 0.0 and (share <= self.options.tolerance or estimate <= _NOTHING):
                return QuickAnswer(moved(self.assembler, state, 1.0, step), force, estimate, True, k)
            state = moved(self.assembler, state, 1.0, mixing.mixed(step))
        return QuickAnswer(state, force, estimate, False, self.options.iterations)

    def _relaxed(self, state: State) -> FloatArray | None:
        """Linear correction of the state without the probe: change of the kept unknowns. None where a cell is
        inverted.
        """
        if state is self.at_rest:
            return np.zeros(len(self.assembler.kept))
        residual = self.assembler.residual(state, 1.0)
        if not residual.min_jacobian > 0.0:
            return None
        return self.assembler.solver.solve_roughly(-np.concatenate([residual.r_u, residual.r_p])[self.assembler.kept])

    def _touched(
        self, contact: Contact, state: State, free: FloatArray, f: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same under the probe: the kept unknowns' change, contact forces (3 s,) on the surface and their sum (3,)
        on the probe.

        free : the change without it. f : a first guess of the forces.
        """
        surface = self.body.surface
        u, du = state.u[surface.nodes], (free[self._row] * self._moves).reshape(-1, 3)
        rows = contact.near(u + du, 0.25 * surface.edge)
        out = np.zeros(len(f))
        if not len(rows):
            return free, out, np.zeros(3)
        patch = Patch.of(surface, rows, self._compliance)
        contact_force, blocks = patch.settle(contact, u, du, f[patch.dofs], _PRECISION * surface.edge)
        out[patch.dofs] = contact_force
        pressed = np.flatnonzero(out)
        return free - out[pressed] @ self._responses[pressed], out, blocks.force

    def _still_to_move(self, state: State, step: FloatArray, f: FloatArray) -> float:
        """The last step over the way from rest: of all nodes, or of those that feel the probe, whichever is more.

        The probe holds the nodes that feel it, so that they alone may stand still while the force still changes.
        """
        n = self.assembler.n_free
        way = state.u.reshape(-1)[self.assembler.kept[:n]] + step[:n]
        share = float(np.linalg.norm(step[:n])) / max(float(np.linalg.norm(way)), 1e-12)
        felt = f.reshape(-1, 3).any(axis=1)
        if not felt.any():
            return share
        du = (step[self._row] * self._moves).reshape(-1, 3)[felt]
        u = state.u[self.body.surface.nodes[felt]] + du
        return max(share, float(np.abs(du).max()) / max(float(np.abs(u).max()), 1e-12))

    def _unit_responses(self) -> FloatArray:
        """(3 s, kept): the kept unknowns under a unit force on each of the surface's degrees of freedom, zero for those
        that are held.
        """
        out = np.zeros((len(self._row), len(self.assembler.kept)))
        for k in range(0, len(out), 64):
            part = np.arange(k, min(k + 64, len(out)))
            unit = np.zeros((len(self.assembler.kept), len(part)))
            unit[self._row[part], np.arange(len(part))] = self._moves[part]
            out[part] = self.assembler.solver.solve(unit).T
        return out


class Mixing:
    """Anderson's mixing of the changes of a fixed-point iteration (Walker & Ni 2011, SIAM J. Numer. Anal. 49:1715, algorithm AA).

    measured : how many leading entries of a change the fit looks at (displacements, not pressures)."""

    def __init__(self, measured: int) -> None:
        self._measured = measured
        self._step: FloatArray | None = None
        self._taken: FloatArray | None = None
        self._changes: list[FloatArray] = []
        self._differences: list[FloatArray] = []

    def mixed(self, step: FloatArray) -> FloatArray:
        """The change to make where the iteration asks for `step` (n,): with the part removed that earlier changes show
        to be overshoot.
        """
        if self._step is not None and self._taken is not None:
            self._changes = [*self._changes, self._taken][-_HISTORY:]
            self._differences = [*self._differences, step - self._step][-_HISTORY:]
        taken = step
        if self._differences:
            D = np.array(self._differences)
            part = D[:, : self._measured]
            c = np.linalg.lstsq(part @ part.T, part @ step[: self._measured], rcond=1e-12)[0]
            taken = step - c @ (np.array(self._changes) + D)
        self._step, self._taken = step, taken
        return taken
