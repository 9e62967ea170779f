"""Particle swarm: SPSO-2011 as Yang & Lin, MaterialCloning, set it (Algorithm 1, Eqs 16 to 19; "the paper" below).

Where the paper leaves something open this follows Clerc, Standard Particle Swarm Optimisation (2012), and
Zambrano-Bigiarini, Clerc and Rojas, Standard Particle Swarm Optimisation 2011 at CEC-2013 (2013). Deviations:

- All particles move at once after all were evaluated, so that evaluations run in parallel; the reference code moves one by one.
- Algorithm 1 starts every fitness at 0, which nothing could improve; here the start is evaluated.
- Algorithm 1 bounds the first velocity by the radius of the search space, which a box does not have; here the first step
  ends inside the box (SPSO-2011).
- Coordinates are scaled to the unit box, so that the spheres below mean something when parameters have different ranges.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.core.inference.swarm_topology import draw_informants, neighbourhood_best

ATTRACTION = 0.5 + np.log(2.0)  # c of Eq 17
INERTIA = 1.0 / (2.0 * np.log(2.0))  # omega of Eq 18
REBOUND = -0.5  # factor on a velocity that hits a bound (SPSO-2011)

_FORMAT = 1
_ARRAYS = (
    "low",
    "high",
    "_x",
    "_v",
    "_best_x",
    "_best_value",
    "_informs",
    "_history_value",
    "_history_x",
    "_positions",
    "_values",
)


@dataclass(frozen=True)
class SwarmOptions:
    """particles : M. informed : K. max_iterations : evaluations of the whole swarm.

    collapse : stop when all personal bests lie within this distance of the best one, as a share of the range.
    patience : stop after so many iterations in a row without improvement of the best. Both are off when 0.
    keep_positions : remember every position and value, for pictures.
    """

    particles: int = 40
    informed: int = 3
    max_iterations: int = 50
    collapse: float = 1e-4
    patience: int = 0
    keep_positions: bool = False


class Swarm:
    """Minimises a function of N coordinates inside a box by ``ask`` and ``tell``.

    Draws only from its own generator, between `tell` and the next `ask`: the answer depends on the seed and the values told,
    not on who computed them or when. ``state`` after any ``tell`` is enough to go on to the same answer to the last bit.
    """

    def __init__(self, low: ArrayLike, high: ArrayLike, seed: int, options: SwarmOptions | None = None) -> None:
        """low, high : (N,) bounds. Raises InputError when they are not finite or not in order, or an option is out of range."""
        self.options = options or SwarmOptions()
        self.low, self.high = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
        self._check()
        self._rng = np.random.default_rng(seed)
        shape = (self.options.particles, len(self.low))
        self._x = self._rng.random(shape)
        self._v = self._rng.uniform(-self._x, 1.0 - self._x)
        self._best_x, self._best_value = self._x.copy(), np.full(shape[0], np.inf)
        self._informs = draw_informants(self._rng, shape[0], self.options.informed)
        self._history_value, self._history_x = np.empty(0), np.empty((0, shape[1]))
        self._positions, self._values = np.empty((0, *shape)), np.empty((0, shape[0]))

    @property
    def iteration(self) -> int:
        """How often values were told."""
        return len(self._history_value)

    @property
    def best_value(self) -> float:
        """Least value so far; inf when every evaluation failed."""
        return float(self._best_value.min())

    @property
    def best_position(self) -> FloatArray:
        """(N,) where the least value was."""
        return self._outside(self._best_x[np.argmin(self._best_value)])

    @property
    def history(self) -> tuple[FloatArray, FloatArray]:
        """After each iteration: best value (t,) and best position (t, N)."""
        return self._history_value.copy(), self._outside(self._history_x)

    @property
    def track(self) -> tuple[FloatArray, FloatArray]:
        """Every position (t, M, N) and value (t, M) with `keep_positions`; otherwise t = 0."""
        return self._outside(self._positions), self._values.copy()

    def ask(self) -> FloatArray:
        """Positions (M, N) to evaluate next; the same until values are told."""
        return self._outside(self._x)

    def tell(self, values: ArrayLike) -> None:
        """Values (M,) at the positions asked for; inf or nan marks a failed evaluation. Moves the swarm on."""
        y = np.array(values, dtype=np.float64)
        if y.shape != self._best_value.shape:
            raise InputError(f"the swarm has {len(self._best_value)} particles but was told values of shape {y.shape}")
        y[np.isnan(y)] = np.inf
        before = self.best_value
        if self.options.keep_positions:
            self._positions = np.concatenate([self._positions, self._x[None]])
            self._values = np.concatenate([self._values, y[None]])
        better = y < self._best_value
        self._best_x[better], self._best_value[better] = self._x[better], y[better]
        leader = np.argmin(self._best_value)
        self._history_value = np.append(self._history_value, self._best_value[leader])
        self._history_x = np.vstack([self._history_x, self._best_x[leader]])
        if not self.best_value < before:
            self._informs = draw_informants(self._rng, self.options.particles, self.options.informed)
        self._move()

    def should_stop(self) -> bool:
        """Whether a stopping rule is met; `stop_reason` says which."""
        return self.stop_reason() is not None

    def stop_reason(self) -> str | None:
        """ "iterations", "collapse", "stagnation", or None to go on."""
        if self.iteration >= self.options.max_iterations:
            return "iterations"
        if np.isfinite(self._best_value).all():
            leader = self._best_x[np.argmin(self._best_value)]
            if np.abs(self._best_x - leader).max() < self.options.collapse:
                return "collapse"
        recent = self._history_value[-self.options.patience - 1 :]
        if 0 < self.options.patience < self.iteration and not recent[-1] < recent[0]:
            return "stagnation"
        return None

    def state(self) -> dict[str, NDArray[np.generic]]:
        """All of it as arrays, for numpy.savez without pickle; `from_state` is the inverse."""
        scalars = {"format": _FORMAT, "options": asdict(self.options), "generator": self._rng.bit_generator.state}
        arrays = {name.lstrip("_"): getattr(self, name).copy() for name in _ARRAYS}
        return {"scalars": np.frombuffer(json.dumps(scalars).encode(), dtype=np.uint8), **arrays}

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[np.generic]]) -> Swarm:
        """The swarm that `state` described; raises InputError when the arrays are not such a state."""
        swarm = cls.__new__(cls)
        try:
            scalars = json.loads(bytes(np.asarray(state["scalars"], dtype=np.uint8)))
            if scalars["format"] != _FORMAT:
                raise InputError(f"swarm state has format {scalars['format']}, not {_FORMAT}; start the search again")
            swarm.options = SwarmOptions(**scalars["options"])
            for name in _ARRAYS:
                setattr(swarm, name, np.array(state[name.lstrip("_")]))
            swarm._rng = np.random.default_rng()
            swarm._rng.bit_generator.state = scalars["generator"]
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"not a swarm state ({error}); start the search again") from error
        return swarm

    def _move(self) -> None:
        """Eqs 16 to 19 for every particle, then confinement to the box."""
        target = neighbourhood_best(self._informs, self._best_value)
        centre = sphere_centre(self._x, self._best_x, self._best_x[target], target == np.arange(len(target)))
        radius = np.linalg.norm(centre - self._x, axis=1)
        self._v = INERTIA * self._v + sample_sphere(self._rng, centre, radius) - self._x  # Eq 18
        self._x = self._x + self._v  # Eq 19
        outside = (self._x < 0.0) | (self._x > 1.0)
        self._x = np.clip(self._x, 0.0, 1.0)
        self._v = np.where(outside, REBOUND * self._v, self._v)

    def _outside(self, unit: FloatArray) -> FloatArray:
        """Coordinates of the caller for coordinates in the unit box; rounding never leaves the bounds."""
        return np.clip(self.low + unit * (self.high - self.low), self.low, self.high)

    def _check(self) -> None:
        low, high, o = self.low, self.high, self.options
        if low.ndim != 1 or low.shape != high.shape or len(low) == 0:
            raise InputError(f"swarm bounds have shapes {low.shape} and {high.shape}; one value a parameter is needed")
        if not (np.isfinite(low).all() and np.isfinite(high).all() and (low < high).all()):
            raise InputError(f"swarm bounds {low.tolist()} to {high.tolist()} must be finite and in ascending order")
        if o.particles < 1 or o.informed < 1 or o.max_iterations < 1 or o.collapse < 0 or o.patience < 0:
            raise InputError(f"swarm options must be positive (collapse and patience may be 0): {o}")


def sphere_centre(x: FloatArray, own: FloatArray, heard: FloatArray, alone: BoolArray) -> FloatArray:
    """Eq 17 for positions (M, N), personal bests and best informants.

    Where a particle is its own best informant (`alone`, (M,)), the third point would count the second twice; the centre is
    then the mean of two points (SPSO-2011).
    """
    near_own, near_heard = x + ATTRACTION * (own - x), x + ATTRACTION * (heard - x)
    return np.where(alone[:, None], (x + near_own) / 2.0, (x + near_own + near_heard) / 3.0)


def sample_sphere(rng: np.random.Generator, centre: FloatArray, radius: FloatArray) -> FloatArray:
    """One point (M, N) in each sphere of centre (M, N), radius (M,): every direction alike, distance r = U(0, radius).

    That is denser near the centre than a uniform density would be; the paper and SPSO-2011 both mean it so.
    """
    direction = rng.standard_normal(centre.shape)
    length = np.linalg.norm(direction, axis=1)
    r = rng.uniform(0.0, 1.0, len(centre)) * radius
    return centre + direction * (r / np.maximum(length, 1e-300))[:, None]
