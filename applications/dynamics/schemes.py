"""Implicit time steps made of stages that are each one backward Euler step from a shifted base.

sdirk2 : two stages, second order, L-stable (Alexander 1977, SIAM J. Numer. Anal. 14:1006). For linear elasticity its
energy never grows; an oscillation of angular frequency w loses the share 0.0074 (w dt)^4 of its energy a step. Constant
forces are exact. backward-euler : one stage, first order; loses the share (w dt)^2 a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.applications.dynamics.motion import Motion, Stage
from palpate.applications.dynamics.stage_solver import solve_stage
from palpate.applications.dynamics.system import MovingBody
from palpate.core.arrays import FloatArray

_GAMMA = 1.0 - np.sqrt(0.5)
# Row by row: how much of the earlier stages' rates the base takes, and the stage's own share.
SCHEMES: dict[str, tuple[tuple[float, ...], ...]] = {
    "sdirk2": ((_GAMMA,), (1.0 - _GAMMA, _GAMMA)),
    "backward-euler": ((1.0,),),
}
DEFAULT_SCHEME = "sdirk2"


@dataclass(frozen=True, eq=False)
class Step:
    """Outcome of a step: motion, or None with the reason. iterations : Newton's.

    viscous, friction : energy dissipated by these, mN mm.
    """

    motion: Motion | None
    reason: str = ""
    iterations: int = 0
    viscous: float = 0.0
    friction: float = 0.0


def take_step(
    body: MovingBody,
    motion: Motion,
    dt: float,
    tolerance: float,
    load: Callable[[float], float] = lambda time: 1.0,
    scheme: str = DEFAULT_SCHEME,
) -> Step:
    """One step of dt s. tolerance : see `solve_stage`. load : fraction of the load of the assembler's terms by time."""
    u, rates, forces = motion.u, list[FloatArray](), list[FloatArray]()
    iterations, viscous, rubbed = 0, 0.0, 0.0
    last = SCHEMES[scheme][-1]
    for k, row in enumerate(SCHEMES[scheme]):
        base, velocity = motion.u, motion.v
        for share, rate, force in zip(row, rates, forces, strict=False):
            base, velocity = base + share * dt * rate, velocity + share * dt * force
        time = motion.time + sum(row) * dt
        stage = Stage(row[-1] * dt, base, velocity, load(time), _damping(body, motion, sum(row) * dt), _rubs(body, u))
        end = solve_stage(body, stage, u, tolerance)
        iterations += end.iterations
        if end.reason:
            return Step(None, end.reason, iterations)
        u = end.u
        rates.append((u - base) / stage.h)
        forces.append((rates[-1] - velocity) / stage.h)
        if stage.damping is not None:
            viscous += last[k] * dt * float((rates[-1] * body.damping_force(stage, u)).sum())
        friction = body.friction(stage)
        if friction is not None:
            rubbed += last[k] * dt * float((rates[-1] * friction.gradient(rates[-1])).sum())
    return Step(Motion(motion.time + dt, u, rates[-1]), "", iterations, viscous, rubbed)


def _damping(body: MovingBody, motion: Motion, ahead: float) -> FloatArray | None:
    """The damping matrix at the predicted displacement; at the old one it would brake a rotating body, an error of
    first order.
    """
    return None if body.viscosity is None else body.viscosity.values(motion.u + ahead * motion.v)


def _rubs(body: MovingBody, u: FloatArray) -> FloatArray | None:
    return u if body.contact is not None and body.contact.friction > 0.0 else None
