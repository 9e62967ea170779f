"""Minimum of one stage's potential by Newton with line search; no trial point crosses a wall or inverts a cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.applications.dynamics.contact import Friction
from palpate.applications.dynamics.motion import Stage
from palpate.applications.dynamics.system import MovingBody
from palpate.core.arrays import FloatArray
from palpate.core.fem.linear.choice import FactorisationError
from palpate.core.fem.newton.work import moved
from palpate.core.fem.state import State

_ARMIJO = 1e-4
_SHORTEST = 1e-7


@dataclass(frozen=True, eq=False)
class StageEnd:
    """u (n, 3) mm; iterations used; reason : "" or why there is no minimum."""

    u: FloatArray
    iterations: int
    reason: str = ""


def solve_stage(body: MovingBody, stage: Stage, start: FloatArray, tolerance: float, most: int = 40) -> StageEnd:
    """The minimum next to `start` (n, 3).

    tolerance : mN mm; ends where a Newton step would lower the potential by less than half of it.
    """
    u, friction = start, body.friction(stage)
    pressure, value = None, body.potential(stage, friction, start)
    for k in range(most):
        state, force = body.elastic_force(u, stage.load)
        g = force + body.gradient(stage, friction, u)
        direction = _newton_direction(body, stage, friction, State(u, state.p if pressure is None else pressure), g)
        if direction is None:
            return StageEnd(u, k, "the stage's matrix could not be factorised")
        slope = float((direction.u * g).sum())
        if not np.isfinite(slope):
            return StageEnd(u, k, "the stage's forces are not finite")
        if -slope <= tolerance:
            return StageEnd(_last_step(body, u, direction.u), k + 1)
        noise = 1e-13 * abs(value) + 0.1 * tolerance
        step = _line_search(body, stage, friction, u, direction.u, (value, slope, noise))
        if step is None:
            return StageEnd(u, k + 1, "the line search found no lower potential")
        length, u, value = step
        pressure = state.p + length * direction.p
    return StageEnd(u, most, f"no minimum in {most} iterations")


def _newton_direction(
    body: MovingBody, stage: Stage, friction: Friction | None, state: State, g: FloatArray
) -> State | None:
    """Step of displacements and pressures; where the matrix has directions of negative curvature, of the projected one.

    The pressure in the matrix is the last step's linear prediction, as in `energy`: the present one is blown up by the
    bulk modulus.
    """
    a = body.assembler
    others = body.curvature(stage, friction, state.u)
    rhs = -np.concatenate([g.reshape(-1), np.zeros(a.space.n_pressures)])[a.kept]
    for project in (False, True):
        values, _ = a.tangent(state, stage.load, project=project)
        try:
            a.solver.factorise(values + others)
        except FactorisationError:
            continue
        if project or a.solver.n_negative() == a.space.n_pressures:
            nothing = State(np.zeros_like(state.u), np.zeros_like(state.p))
            return moved(a, nothing, 1.0, a.solver.solve(rhs))
    return None


def _last_step(body: MovingBody, u: FloatArray, step: FloatArray) -> FloatArray:
    """State after the converged step, where that is free of collisions: the step is known already and squares the
    error.
    """
    trial = u + step
    free = body.contact is None or body.contact.free_share(u, trial) >= 1.0
    return trial if free and body.assembler.min_jacobian(trial) > 0.0 else u


def _line_search(
    body: MovingBody,
    stage: Stage,
    friction: Friction | None,
    u: FloatArray,
    step: FloatArray,
    at: tuple[float, float, float],
) -> tuple[float, FloatArray, float] | None:
    """Length, displacements and potential of a step that is free of collisions and goes down; None when there is none.

    at : the potential, its slope along the step and what of it is rounding, mN mm.
    """
    value, slope, noise = at
    length = 1.0 if body.contact is None else body.contact.free_share(u, u + step)
    while length > _SHORTEST:
        trial = u + length * step
        lower = body.potential(stage, friction, trial)
        if lower <= value + _ARMIJO * length * slope + noise:
            return length, trial, lower
        length *= 0.5
    return None
