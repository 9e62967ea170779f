"""Static equilibrium (Eq 2 of Yang & Lin) by a Newton method for inverted starts, large loads and nearly incompressible
organs.

Two iterations share one matrix. The mixed one (`mixed`) is quick and does not test stability; the energy one (`energy`)
ends in a minimum. The load increment is halved when neither converges. Failure is a value with its reason.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.energy import leave_saddle, minimise
from palpate.core.fem.newton.mixed import Outcome, iterate_mixed
from palpate.core.fem.newton.work import NewtonOptions, Work, relative
from palpate.core.fem.state import State
from palpate.core.fem.tangent import Tangent

__all__ = ["Equilibrium", "NewtonOptions", "solve_equilibrium"]

# Load increments above this are halved when the mixed iteration fails with a definite tangent; below it the energy
# iteration serves.
_PATIENCE = 0.1
# Largest number of energy iterations above and below that increment: far from the solution, half the load costs less.
_FEW, _MANY = 20, 80


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The outcome of a solve.

    converged : a stable equilibrium was found. reason : "" or why not. u (n, 3) mm, p (n_p,) kPa: the last good state.
    load : fraction reached. stable : inertia says minimum (None when not checked). residual : relative. min_jacobian :
    of guarded cells. buckled : the path to it went through a loss of stability, so that another branch may exist as
    well. certified : tangent at (u, p), None where the solve failed or was made without its stability check.
    """

    converged: bool
    reason: str
    u: FloatArray
    p: FloatArray
    load: float
    stable: bool | None
    residual: float
    min_jacobian: float
    factorisations: int
    backsolves: int
    load_steps: int
    buckled: bool = False
    certified: Tangent | None = field(default=None, repr=False)

    @property
    def tangent(self) -> Tangent:
        """Tangent at (u, p). Raises ValueError where there is none."""
        if self.certified is None:
            raise ValueError("no tangent at this state: solve with NewtonOptions(stability=True) until it converges")
        return self.certified


def solve_equilibrium(
    assembler: Assembler,
    materials: Mapping[int, Material] | None = None,
    prescribed: FloatArray | None = None,
    start: FloatArray | State | None = None,
    options: NewtonOptions | None = None,
) -> Equilibrium:
    """Equilibrium under the full load of the assembler's terms and `prescribed` displacements.

    materials : new ones, or None for those already set. prescribed : (3 n,) mm, read where unknowns are not free;
    default zero. start : displacements (n, 3) or a whole state to start from (a neighbour's solution); an inverted
    start is repaired or dropped.
    """
    options = options or NewtonOptions()
    if materials is not None:
        assembler.set_materials(materials)
    goal = np.zeros(assembler.space.n_displacements) if prescribed is None else np.asarray(prescribed, float).copy()
    goal[assembler.free] = 0.0
    work = Work(options)
    with np.errstate(all="ignore"):  # a failed trial step may overflow; its result is tested for being finite
        state, load, stable = _march(assembler, goal, start, work)
        residual = assembler.residual(state, load)
    ok = load == 1.0 and work.reason == "" and stable is not False
    return Equilibrium(
        converged=ok,
        reason=work.reason if work.reason or ok else "the equilibrium found is not stable",
        u=state.u,
        p=state.p,
        load=load,
        stable=stable,
        residual=relative(assembler, residual),
        min_jacobian=residual.min_jacobian,
        factorisations=work.factorisations,
        backsolves=work.backsolves,
        load_steps=work.load_steps,
        buckled=work.buckled,
        certified=work.tangent if ok else None,
    )


def _march(
    assembler: Assembler, goal: FloatArray, start: FloatArray | State | None, work: Work
) -> tuple[State, float, bool | None]:
    """Raise the load to 1: at once from a given start, else in as large steps as converge."""
    rest = State(np.zeros((assembler.space.n_nodes, 3)), np.zeros(assembler.space.n_pressures))
    first = _usable_start(assembler, start)
    if first is not None:
        outcome = _one_load(assembler, first, goal, 0.0, 1.0, work)
        if outcome.converged:
            work.reason = ""
            return outcome.state, 1.0, outcome.stable
    state, load, step, stable = rest, 0.0, 1.0, None
    while load < 1.0:
        target = min(1.0, load + step)
        outcome = _one_load(assembler, state, goal, load, target, work)
        if outcome.converged:
            state, load, stable, step = outcome.state, target, outcome.stable, 2.0 * step
            continue
        step = 0.5 * (target - load)
        if step < work.options.min_load_step or work.exhausted:
            work.reason = f"stopped at {100 * load:.0f} % of the load: {work.reason or 'no equilibrium within reach'}"
            return state, load, stable
    work.reason = ""
    return state, load, stable


def _usable_start(assembler: Assembler, start: FloatArray | State | None) -> State | None:
    if start is None:
        return None
    state = start if isinstance(start, State) else None
    u = state.u if state is not None else np.asarray(start, dtype=float).reshape(-1, 3)
    if not np.isfinite(u).all() or not assembler.min_jacobian(u) > 0.0:
        return None  # inverted: the march from rest, where J = 1, is safer than repairing it
    if state is not None and np.isfinite(state.p).all():
        return State(u.copy(), state.p.copy())
    return State(u.copy(), assembler.balanced_pressure(u))


def _one_load(assembler: Assembler, state: State, goal: FloatArray, reached: float, load: float, work: Work) -> Outcome:
    """One load level: mixed iteration; the energy iteration if that ended unstable, or failed where half the step would
    not help.
    """
    work.load_steps += 1
    outcome = iterate_mixed(assembler, state, goal, load, work)
    if outcome.converged and outcome.stable is not False:
        return outcome
    if outcome.stable is False and not work.options.follow_buckling:
        work.reason = "the body loses its stability under this load (it buckles)"
        return replace(outcome, converged=False)
    if outcome.converged:
        lower = leave_saddle(assembler, outcome.state, load, work)
        if lower is None:
            work.reason = "the equilibrium found is not stable"
            return replace(outcome, converged=False)
        work.buckled = True
        return minimise(assembler, lower, goal, load, work)
    if not outcome.in_place:
        return outcome
    if outcome.stable is not False and load - reached > _PATIENCE:
        return outcome  # half the increment is cheaper than many energy iterations
    return _descend(assembler, outcome, goal, load, work, _FEW if load - reached > _PATIENCE else _MANY)


def _descend(
    assembler: Assembler, outcome: Outcome, goal: FloatArray, load: float, work: Work, iterations: int
) -> Outcome:
    """Energy iteration from the last state of a failed mixed one; it may reach another branch from an indefinite
    tangent.
    """
    if not work.options.follow_buckling:
        return outcome
    end = minimise(assembler, outcome.state, goal, load, work, iterations)
    work.buckled |= end.converged and outcome.stable is False
    return end
