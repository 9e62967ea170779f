"""Many particles of one scene at once: each starts from a near neighbour's equilibrium, and no bit depends on who computes it.

Particles are put in one row by a nearest-neighbour tour and cut into blocks of a fixed size. A block is solved by one process
from its first particle to its last, each started from the one before, the first from the same given state as every other block.
So the row, the blocks and every start follow from the particles alone, not from the number of workers or their speed.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions
from palpate.core.fem.state import State

# Longer blocks start more particles from a near neighbour, shorter ones share work more evenly: measured, see `palpate bench`.
BLOCK = 5


class ParticleScene(Protocol):
    """A scene that can be solved for any parameters; its answer may depend on these arguments alone."""

    def solve(self, theta: FloatArray, start: State | None, options: NewtonOptions | None) -> Equilibrium:
        """Equilibrium at theta (k,)."""


# Makes the scene in the process that needs it: importable and picklable (a class, a function, functools.partial of one).
SceneFactory = Callable[[], ParticleScene]
# What is wanted of an equilibrium: (scene, theta, equilibrium) -> array, such as a misfit or observed displacements.
Observe = Callable[[Any, FloatArray, Equilibrium], Any]


@dataclass(frozen=True, eq=False)
class Particle:
    """theta (k,); value : what `observe` made of its equilibrium, inf () where there is none; reason : "" or why there is none."""

    theta: FloatArray
    value: FloatArray
    reason: str
    factorisations: int

    @property
    def converged(self) -> bool:
        """Whether there is an equilibrium."""
        return self.reason == ""


@dataclass(frozen=True, eq=False)
class _Block:
    key: str
    factory: bytes
    thetas: FloatArray
    start: State | None
    options: NewtonOptions | None
    observe: Observe


def solve_many(
    factory: SceneFactory,
    thetas: FloatArray,
    executor: Executor,
    observe: Observe,
    start: State | None = None,
    options: NewtonOptions | None = None,
    block: int = BLOCK,
) -> list[Particle]:
    """Solve thetas (m, k) with the executor's workers (`worker.executors.make_executor`); particles in the order given.

    start : state from which every block begins, or None for the rest state. Results do not depend on the number of workers nor
    on the order of thetas. Raises InputError for a shape that is not (m, k).
    """
    thetas = np.asarray(thetas, dtype=float)
    if thetas.ndim != 2:
        raise InputError(f"particles have shape {thetas.shape}; (particles, parameters) is needed")
    finite = np.isfinite(thetas).all(axis=1)
    order = np.flatnonzero(finite)[tour(thetas[finite])]
    pickled = pickle.dumps(factory)
    key = hashlib.sha256(pickled).hexdigest()
    parts = [order[i : i + block] for i in range(0, len(order), block)]
    blocks = [_Block(key, pickled, thetas[part], start, options, observe) for part in parts]
    particles = {
        int(i): Particle(thetas[i], np.array(np.inf), "a parameter is not finite", 0) for i in np.flatnonzero(~finite)
    }
    for part, solved in zip(parts, executor.map(_solve_block, blocks), strict=True):
        particles.update(zip(part.tolist(), solved, strict=True))
    return [particles[i] for i in range(len(thetas))]


def tour(thetas: FloatArray) -> IntArray:
    """Indices (m,) of thetas (m, k) in the order of a walk that always goes to the nearest one left; first the least in dictionary order.

    The walk does not depend on the order in which thetas are given.
    """
    if len(thetas) == 0:
        return np.zeros(0, dtype=np.int64)
    dictionary = np.lexsort(thetas.T[::-1])
    points = thetas[dictionary]
    left = np.ones(len(points), dtype=bool)
    walk = [0]
    left[0] = False
    for _ in range(len(points) - 1):
        distance = ((points - points[walk[-1]]) ** 2).sum(axis=1)
        distance[~left] = np.inf
        walk.append(int(np.argmin(distance)))
        left[walk[-1]] = False
    return dictionary[walk]


_SCENE: tuple[str, ParticleScene] | None = None


def _scene(key: str, factory: bytes) -> ParticleScene:
    """This process's copy of the scene, made once; another scene replaces it."""
    global _SCENE
    if _SCENE is None or _SCENE[0] != key:
        _SCENE = None  # the old one's memory first
        _SCENE = key, pickle.loads(factory)()
    return _SCENE[1]


def _solve_block(block: _Block) -> Sequence[Particle]:
    """One chain; a particle without equilibrium does not break it: the next starts from the last that has one."""
    scene = _scene(block.key, block.factory)
    state, out = block.start, []
    for theta in block.thetas:
        found = scene.solve(theta, state, block.options)
        if found.converged:
            state = State(found.u, found.p)
            value = np.asarray(block.observe(scene, theta, found), dtype=float)
            out.append(Particle(theta, value, "", found.factorisations))
        else:
            reason = found.reason or "no equilibrium"
            out.append(Particle(theta, np.array(np.inf), reason, found.factorisations))
    return out
