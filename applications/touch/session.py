"""A session of touches: place the probe, press or pull, slide; all answers are kept for the force curve."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from palpate.applications.touch.body import Body
from palpate.applications.touch.full import FullTouch
from palpate.applications.touch.probe import Contact
from palpate.applications.touch.quick import QuickOptions, QuickTouch
from palpate.applications.touch.surface import Touched
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.fem.state import State

# Largest indentation relative to the probe's radius, and to the body's.
_DEEPEST_OF_PROBE, _DEEPEST_OF_BODY = 0.65, 0.3
# Radius of the gripped patch over the probe's radius.
_GRIP = 0.7
# Least and largest difference of indentation, mm, between two answers whose slope counts as stiffness.
_LEAST_CHANGE, _NEAR_CHANGE = 0.02, 0.6

_N = 1e-3  # newton per millinewton (kPa mm2)


@dataclass(frozen=True, eq=False)
class Answer:
    """Response of the body to the probe.

    touch : number of the touch, from 1. radius : of the probe, mm. region : id behind the touched face. point, normal :
    (3,) of the surface at rest. indentation_mm : how far the probe reaches in beyond the surface at rest; negative when
    it pulls. force_n : against it, newton, negative when the body pulls back. force : (3,) newton on the probe. error_n
    : estimate. full : whether a full solve was needed. stiffness_n_per_mm : slope of force against indentation along
    this touch, None before there are two answers. ok : False where no equilibrium was found; then the force is that of
    the last state and `reason` says why. u : (n, 3) mm.
    """

    touch: int
    radius: float
    region: int
    point: FloatArray
    normal: FloatArray
    indentation_mm: float
    force_n: float
    force: FloatArray
    error_n: float
    full: bool
    stiffness_n_per_mm: float | None
    ok: bool
    reason: str
    u: FloatArray


@dataclass(eq=False)
class Session:
    """A session with one body. radius : of the probe, mm. correct : whether full solves are made where needed.

    answers : all so far, without their displacements.
    """

    body: Body
    radius: float = 8.0
    options: QuickOptions | None = None
    correct: bool = True
    answers: list[Answer] = field(default_factory=list)
    _state: State | None = field(default=None, init=False)
    _at: Touched | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.take(self.radius)
        self.quick = QuickTouch(self.body, self.options)
        self._full: FullTouch | None = None
        self._touches = 0

    @property
    def deepest(self) -> float:
        """Largest indentation and largest pull, mm."""
        return min(_DEEPEST_OF_PROBE * self.radius, _DEEPEST_OF_BODY * self.body.radius)

    @property
    def at(self) -> Touched | None:
        """Point of the surface at rest that the probe touches."""
        return self._at

    def take(self, radius: float) -> None:
        """Change the probe's radius, mm; the new probe touches nothing yet. Raises InputError when it is too small
        or too large.
        """
        if not 0.5 <= radius <= 50.0:
            raise InputError(f"a probe's radius of {radius:g} mm is out of range; give 0.5 to 50")
        self.radius, self._at, self._state = radius, None, None

    def touch(self, point: FloatArray) -> Touched:
        """Puts the probe on the surface at rest, nearest to a point (3,) mm. A new touch begins. Raises InputError when
        it is no point.
        """
        point = np.asarray(point, dtype=float)
        if point.shape != (3,) or not np.isfinite(point).all():
            raise InputError(f"{point.tolist()} is no point; give three coordinates in mm")
        self._at, self._state = self.body.surface.nearest(point), None
        self._touches += 1
        return self._at

    def slide(self, point: FloatArray) -> Touched:
        """The same touch goes on at the place of the surface at rest nearest to a point (3,) mm."""
        if self._at is None:
            return self.touch(point)
        self._at = self.body.surface.nearest(np.asarray(point, dtype=float))
        return self._at

    def press(self, indentation_mm: float) -> Answer:
        """Move the probe to an indentation, mm (negative: a pull), limited by `deepest`.

        Raises InputError before a touch and for what is no number.
        """
        if self._at is None:
            raise InputError("the probe touches nothing yet; touch a point first")
        if not np.isfinite(indentation_mm):
            raise InputError(f"{indentation_mm} mm is no indentation")
        depth = float(np.clip(indentation_mm, -self.deepest, self.deepest))
        answer = self._answer(self._at, depth)
        self.answers.append(replace(answer, u=np.zeros((0, 3))))
        return answer

    def contact(self, at: Touched, depth: float) -> Contact:
        """The probe at a place of the surface and a depth, mm; a negative one grips and pulls."""
        if depth < 0.0:
            return self.body.grip(at.point, _GRIP * self.radius, -depth * at.normal)
        start = at.point + self.radius * at.normal
        return self.body.press(start - depth * at.normal, self.radius, start)

    def _answer(self, at: Touched, depth: float) -> Answer:
        contact = self.contact(at, depth)
        quick = self.quick.answer(contact, self._state)
        if not quick.good and self._state is not None:
            quick = self.quick.answer(contact)  # the neighbour was too far away
        state, force, error, ok, reason, full = quick.state, quick.force, quick.estimate, quick.good, "", False
        if not ok and self.correct:
            self._full = self._full or FullTouch(self.body)
            solved = self._full.solve(contact, self._state)
            state, force, ok, reason, full = solved.state, solved.force, solved.converged, solved.reason, True
            error = 0.0 if ok else np.inf
        elif not ok:
            reason = "the quick answer did not settle"
        self._state = state if ok else None
        force_n = float(force @ at.normal) * _N
        return Answer(
            touch=self._touches, radius=self.radius, region=self.body.region_of(at.face), point=at.point,
            normal=at.normal, indentation_mm=depth,
            force_n=force_n, force=force * _N, error_n=error * _N, full=full,
            stiffness_n_per_mm=self._slope(at, depth, force_n), ok=ok, reason=reason, u=state.u,
        )  # fmt: skip

    def _slope(self, at: Touched, depth: float, force_n: float) -> float | None:
        for before in reversed(self.answers):
            change = depth - before.indentation_mm
            if before.touch != self._touches or abs(change) > _NEAR_CHANGE:
                break
            if before.ok and abs(change) >= _LEAST_CHANGE and np.array_equal(before.point, at.point):
                return (force_n - before.force_n) / change
        return None
