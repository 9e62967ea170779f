"""Time integration. A step that gains energy or has no minimum is repeated with half its length, at last by backward
Euler.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from palpate.applications.dynamics.motion import Energies, Motion
from palpate.applications.dynamics.schemes import DEFAULT_SCHEME, Step, take_step
from palpate.applications.dynamics.system import MovingBody
from palpate.core.errors import ConvergenceError

_NEWTON = 1e-10  # tolerance of a stage's minimum, relative to the energy scale
_ROUNDING = 1e-9  # relative to the energy scale, per step
# Number of halvings after which backward Euler takes the step: first order, but it dissipates energy where the other
# scheme may gain some.
_HALVINGS = 3
_PATIENCE = 4  # good steps after which a halved one is doubled again


@dataclass(frozen=True)
class MarchOptions:
    """dt : s, the longest step. energy_tolerance : how far above its lowest value so far the mechanical energy may ever
    be, relative to `Ledger.scale`. shortest : s, below which a march gives up. scheme : see `schemes`.

    load : fraction of the load of the assembler's terms by time; a load that changes does work, so then energy is not
    watched.
    """

    dt: float
    energy_tolerance: float = 1e-3
    shortest: float = 1e-7
    scheme: str = DEFAULT_SCHEME
    load: Callable[[float], float] | None = None


@dataclass
class Ledger:
    """Account of a march so far. energies : after every step, the start first; times : s of the same.

    scale : mN mm that tolerances refer to. viscous, friction : mN mm lost to these. rejected : steps taken again.
    dt : s, the step now allowed, after `good` steps in a row that were taken, or `refused` ones that were not.
    """

    scale: float
    times: list[float] = field(default_factory=list)
    energies: list[Energies] = field(default_factory=list)
    viscous: float = 0.0
    friction: float = 0.0
    iterations: int = 0
    rejected: int = 0
    dt: float = np.inf
    good: int = 0
    refused: int = 0

    @property
    def lowest(self) -> float:
        """Lowest mechanical energy so far."""
        return min(e.total for e in self.energies)

    @property
    def largest_growth(self) -> float:
        """Largest excess of the mechanical energy over its lowest earlier value, relative to the scale."""
        totals = np.array([e.total for e in self.energies])
        return float(np.max(totals - np.minimum.accumulate(totals), initial=0.0)) / self.scale

    @property
    def unaccounted(self) -> float:
        """Share of the scale that was lost beyond what viscosity and friction are booked with: what the time steps
        took.

        Both are summed by the steps' own quadrature, which is too high where speeds change within a step, so it may be
        negative.
        """
        return (self.energies[0].total - self.energies[-1].total - self.viscous - self.friction) / self.scale


def open_ledger(body: MovingBody, motion: Motion, height: float | None = None) -> Ledger:
    """Ledger of a march that starts from a motion.

    height : mm a body will fall, for the scale; the body's own size by default.
    """
    first = body.energies(motion)
    nodes = body.assembler.space.nodes
    size = float(np.ptp(nodes, axis=0).max()) if height is None else height
    weight = float(np.linalg.norm(body.weight.sum(axis=0)))
    scale = first.kinetic + abs(first.elastic) + weight * size
    return Ledger(max(scale, 1e-12), [motion.time], [first])


def march(
    body: MovingBody,
    motion: Motion,
    until: float,
    options: MarchOptions,
    ledger: Ledger | None = None,
    watch: Callable[[Motion], None] | None = None,
) -> Motion:
    """The motion at time `until`, s. watch : called after every step.

    Raises ConvergenceError when even the shortest step fails.
    """
    ledger = open_ledger(body, motion) if ledger is None else ledger
    while until - motion.time > 1e-9 * options.dt:
        remaining = until - motion.time
        dt = remaining / max(1.0, float(np.ceil(remaining / min(options.dt, ledger.dt) - 1e-9)))
        scheme = options.scheme if ledger.refused < _HALVINGS else "backward-euler"
        step = take_step(body, motion, dt, _NEWTON * ledger.scale, options.load or _full, scheme)
        after = None if step.motion is None else body.energies(step.motion)
        if step.motion is None or after is None or _too_much(after, ledger, options):
            _reject(ledger, step, dt, options)
            continue
        motion = step.motion
        _accept(ledger, step, after, motion.time, options)
        if watch is not None:
            watch(motion)
    return motion


def _full(time: float) -> float:
    return 1.0


def _too_much(after: Energies, ledger: Ledger, options: MarchOptions) -> bool:
    if options.load is not None:
        return not np.isfinite(after.total)
    # A step may use up at most half of the remaining energy tolerance: with none remaining, rounding alone would stop
    # the march.
    above = (ledger.energies[-1].total - ledger.lowest) / ledger.scale
    allowed = max(0.5 * (options.energy_tolerance - above), min(_ROUNDING, options.energy_tolerance))
    return not after.total <= ledger.energies[-1].total + allowed * ledger.scale


def _accept(ledger: Ledger, step: Step, after: Energies, time: float, options: MarchOptions) -> None:
    ledger.times.append(time)
    ledger.energies.append(after)
    ledger.viscous += step.viscous
    ledger.friction += step.friction
    ledger.iterations += step.iterations
    ledger.good, ledger.refused = ledger.good + 1, 0
    if ledger.good >= _PATIENCE and ledger.dt < options.dt:
        ledger.dt, ledger.good = min(2.0 * ledger.dt, options.dt), 0


def _reject(ledger: Ledger, step: Step, dt: float, options: MarchOptions) -> None:
    ledger.rejected += 1
    ledger.iterations += step.iterations
    ledger.dt, ledger.good, ledger.refused = 0.5 * dt, 0, ledger.refused + 1
    if ledger.dt < options.shortest:
        why = step.reason or "the energy grows however short the step"
        raise ConvergenceError(f"the motion stops at {1e3 * ledger.times[-1]:.1f} ms: {why}")
