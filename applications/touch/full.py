"""The full equilibrium of a touched body: nonlinear law in every cell, and contact.

The force has kinks where nodes come into contact, and the step control of `core.fem.newton.newton` stalls there. Full
Newton steps, shortened only where a cell would be inverted, find the set of nodes in contact within a few iterations
(Hueber & Wohlmuth 2005, Comput. Methods Appl. Mech. Engng 194:3147). Where they fail the probe moves in increments.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.applications.touch.body import Body
from palpate.applications.touch.probe import Contact, Grip
from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.linear.choice import FactorisationError
from palpate.core.fem.newton.work import moved, relative
from palpate.core.fem.state import State

_ITERATIONS = 25
# Largest number of factorisations per touch: a person waits for the answer.
_MOST = 150
_SMALLEST_PART = 1.0 / 64.0


@dataclass(frozen=True, eq=False)
class FullAnswer:
    """converged : within tolerance; otherwise `reason` says why not. state : the last one. force : (3,) mN on the
    probe.

    iterations : factorisations, all parts of the way together.
    """

    converged: bool
    reason: str
    state: State
    force: FloatArray
    iterations: int


class FullTouch:
    """One body, ready for any place of the probe. rtol : residual relative to the forces inside the body."""

    def __init__(self, body: Body, solver: str = "auto", rtol: float = 1e-7) -> None:
        self.body = body
        self.rtol = rtol
        s = body.surface
        nothing = Grip(s, np.zeros(s.faces.shape), np.zeros(3), np.zeros(len(s.faces)))
        self.assembler = body.assembler(nothing, solver=solver)
        self._support = self.assembler.terms[:-1]

    def at_rest(self) -> State:
        """State without displacement."""
        return State(np.zeros((self.body.space.n_nodes, 3)), np.zeros(self.body.space.n_pressures))

    def solve(self, contact: Contact, start: State | None = None) -> FullAnswer:
        """Equilibrium under the probe. start : a state to start from, with the probe in its place at once; otherwise
        from rest.
        """
        self.assembler.terms = (*self._support, contact)
        used = 0
        if start is not None:
            equilibrium, used = _newton(self.assembler, start, 1.0, self.rtol)
            if equilibrium is not None:
                return self._answer(contact, equilibrium, used)
        state, load, part = self.at_rest(), 0.0, 1.0
        while load < 1.0:
            equilibrium, more = _newton(self.assembler, state, min(1.0, load + part), self.rtol)
            used += more
            if equilibrium is not None:
                state, load, part = equilibrium, min(1.0, load + part), 2.0 * part
                continue
            part = 0.5 * min(part, 1.0 - load)
            if part < _SMALLEST_PART or used > _MOST:
                why = f"no equilibrium beyond {100.0 * load:.0f} % of the probe's way"
                return FullAnswer(False, why, state, self.force(contact, state.u), used)
        return self._answer(contact, state, used)

    def force(self, contact: Contact, u: FloatArray) -> FloatArray:
        """(3,) mN on the probe at nodal displacements u (n, 3) mm."""
        every = np.arange(len(self.body.surface.faces))
        return contact.blocks(every, u[self.body.surface.nodes], 1).force

    def _answer(self, contact: Contact, state: State, used: int) -> FullAnswer:
        return FullAnswer(True, "", state, self.force(contact, state.u), used)


def _newton(assembler: Assembler, state: State, load: float, rtol: float) -> tuple[State | None, int]:
    """Full steps from a state to the equilibrium at a load, None where they do not arrive; and the factorisations."""
    for used in range(_ITERATIONS):
        residual = assembler.residual(state, load)
        if relative(assembler, residual) <= rtol:
            return state, used
        values, _ = assembler.tangent(state, load)
        try:
            assembler.solver.factorise(values)
            step = assembler.solver.solve(-np.concatenate([residual.r_u, residual.r_p])[assembler.kept])
        except FactorisationError:
            return None, used + 1
        length = 1.0
        trial = moved(assembler, state, length, step)
        while not assembler.min_jacobian(trial.u) > 0.05 * min(1.0, residual.min_jacobian):
            length *= 0.5
            if length < 1e-3:
                return None, used + 1
            trial = moved(assembler, state, length, step)
        state = trial
    return None, _ITERATIONS
