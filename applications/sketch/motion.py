"""The figure between its keyframes and beyond them: rim forces that change smoothly, then a free swing back.

Between keyframes every picture is an equilibrium under forces between the keyframes' own. Beyond the last one the
forces go on the same way for a little, and then let go: the body swings back to its first shape by its own dynamics.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.applications.dynamics.march import MarchOptions, march
from palpate.applications.dynamics.mass import Mass
from palpate.applications.dynamics.motion import Motion
from palpate.applications.dynamics.system import MovingBody
from palpate.applications.sketch.figure import Figure
from palpate.applications.sketch.fit import Fit
from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.state import State
from palpate.core.worker.progress import Progress, silent

# Two paths reach the same keyframe when their ends differ by less than this, in figure sizes.
_SAME = 0.01
# Extrapolation of the forces beyond the last keyframe, as a share of the last leg.
_BEYOND = 0.25
# Period of the free swing, s, which sets the density, and its damping ratio; both chosen for a picture, not measured.
_PERIOD, _DAMPING = 1.0, 0.1


@dataclass(frozen=True)
class MotionOptions:
    """Pictures of each leg between keyframes, of a keyframe held still, beyond the last one, and of the swing; their
    rate, 1/s.
    """

    leg: int = 20
    still: int = 6
    beyond: int = 8
    swing: int = 45
    rate: float = 25.0


@dataclass
class Moving:
    """u : (n, 3) mm of each picture. said : what each shows. notes : what could not be computed."""

    u: list[FloatArray] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, u: FloatArray, said: str) -> None:
        """One more picture."""
        self.u.append(u)
        self.said.append(said)


@dataclass(frozen=True, eq=False)
class _Load:
    """force : (n, 3) mN on nodes. goal (q, 3) mm and spring : see `Figure.loaded`."""

    force: FloatArray
    goal: FloatArray
    spring: float

    def towards(self, other: _Load, share: float) -> _Load:
        """Part of the way to another, or beyond it."""
        force = self.force + share * (other.force - self.force)
        return _Load(force, self.goal + share * (other.goal - self.goal), self.spring)

    def put_on(self, figure: Figure) -> None:
        """See `Figure.loaded`."""
        figure.loaded(self.force, self.goal if self.spring > 0.0 else None, self.spring)


def animate(figure: Figure, fit: Fit, options: MotionOptions | None = None, progress: Progress = silent) -> Moving:
    """All pictures from the first keyframe through the others, beyond the last, and back."""
    options = options or MotionOptions()
    basis = figure.force_basis(fit.degree)
    rest = State(np.zeros((figure.space.n_nodes, 3)), np.zeros(figure.space.n_pressures))
    loads = [_Load(np.zeros_like(rest.u), np.zeros((len(figure.outline.points), 3)), fit.spring)]
    for k, forces in enumerate(fit.forces):
        goal = loads[0].goal if fit.goals is None else fit.goals[k]
        loads.append(_Load(np.tensordot(forces, basis, 1), goal, fit.spring))
    states = [rest, *(State(e.u, e.p) for e in fit.states)]
    out = Moving()
    legs = len(states) - 1
    for k in range(legs):
        progress(0.6 * k / legs, f"between keyframes {k + 1} and {k + 2}")
        for _ in range(options.still):
            out.add(states[k].u, f"keyframe {k + 1}")
        for u in _leg(figure, fit.theta, loads[k : k + 2], states[k : k + 2], options.leg, out.notes):
            out.add(u, f"between keyframes {k + 1} and {k + 2}")
    for _ in range(options.still):
        out.add(states[-1].u, f"keyframe {legs + 1}")
    progress(0.6, "beyond the last keyframe")
    last = _beyond(figure, fit.theta, loads[-2:], states[-1], options.beyond, out)
    progress(0.7, "letting go")
    _swing(figure, fit.theta, last, options, out)
    return out


def _leg(
    figure: Figure, theta: FloatArray, loads: list[_Load], ends: list[State], count: int, notes: list[str]
) -> list[FloatArray]:
    """Displacements strictly between two states: from the first onwards, else from the second backwards, else
    blended.
    """
    shares = _smooth(np.arange(1, count + 1) / (count + 1))
    for way, (start, goal) in (("on", (ends[0], ends[1])), ("back", (ends[1], ends[0]))):
        order = shares if way == "on" else shares[::-1]
        equilibria = _follow(figure, theta, [loads[0].towards(loads[1], s) for s in order], start)
        if len(equilibria) == count and _near(figure, theta, loads[1 if way == "on" else 0], equilibria[-1], goal):
            us = [e.u for e in equilibria]
            return us if way == "on" else us[::-1]
    notes.append("no path of equilibria joins two keyframes: what lies between them was blended")
    return [(1 - s) * ends[0].u + s * ends[1].u for s in shares]


def _follow(figure: Figure, theta: FloatArray, loads: list[_Load], start: State) -> list[Equilibrium]:
    equilibria: list[Equilibrium] = []
    for load in loads:
        load.put_on(figure)
        end = figure.equilibrium(theta, start)
        if not end.converged:
            break
        equilibria.append(end)
        start = State(end.u, end.p)
    return equilibria


def _near(figure: Figure, theta: FloatArray, load: _Load, last: Equilibrium, goal: State) -> bool:
    """Whether one more step ends at its goal."""
    end = _follow(figure, theta, [load], State(last.u, last.p))
    return bool(end) and float(np.abs(end[0].u - goal.u).max()) < _SAME * figure.outline.size


def _beyond(figure: Figure, theta: FloatArray, loads: list[_Load], start: State, count: int, out: Moving) -> State:
    share = _BEYOND * np.sin(0.5 * np.pi * np.arange(1, count + 1) / max(count, 1))
    equilibria = _follow(figure, theta, [loads[0].towards(loads[1], 1.0 + s) for s in share], start)
    for end in equilibria:
        out.add(end.u, "beyond the last keyframe")
    if len(equilibria) < count:
        out.notes.append("the forces cannot go further beyond the last keyframe: no equilibrium follows")
    return State(equilibria[-1].u, equilibria[-1].p) if equilibria else start


def _swing(figure: Figure, theta: FloatArray, start: State, options: MotionOptions, out: Moving) -> None:
    """Free swing without forces."""
    figure.loaded(np.zeros_like(start.u))
    figure.assembler.set_materials(figure.materials(theta))
    squared = float((start.u * Mass.of(figure.space, 1.0).times(start.u)).sum())
    # Secant stiffness of the shape it starts from: twice the energy over the squared way.
    stiffness = 2.0 * figure.assembler.energy(start.u, 1.0)
    if options.swing == 0 or not stiffness > 0.0:
        return
    density = stiffness / squared * (_PERIOD / (2.0 * np.pi)) ** 2
    body = MovingBody(figure.assembler, density, damping=_DAMPING * _PERIOD / np.pi)
    motion = Motion(0.0, start.u, np.zeros_like(start.u))
    step = MarchOptions(1.0 / options.rate)
    try:
        for k in range(options.swing):
            motion = march(body, motion, (k + 1) / options.rate, step)
            out.add(motion.u, "let go")
    except ConvergenceError as error:
        out.notes.append(f"the swing back ends early: {error}")


def _smooth(s: FloatArray) -> FloatArray:
    """Smooth step from 0 to 1 with zero slope at both ends."""
    return s * s * (3.0 - 2.0 * s)
