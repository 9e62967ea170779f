"""Solution of many particles of one scene. Results are independent of the number and speed of the workers.

Particles are ordered by a nearest-neighbour tour and cut into blocks of fixed size. One process solves one block in
order. Each particle starts from the equilibrium of the one before; the first of each block starts from one given state.
Order, blocks and starts therefore follow from the particles alone.
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

# Particles of a block. Longer blocks give nearer starts, shorter ones an even load. Chosen with `palpate bench`.
BLOCK = 5


class ParticleScene(Protocol):
    """Scene that can be solved for any parameters. Precondition: its answer depends on the arguments of `solve` alone."""

    def solve(self, theta: FloatArray, start: State | None, options: NewtonOptions | None) -> Equilibrium:
        """Equilibrium at theta (k,), continued from the state `start`."""


# Factory that builds the scene in a worker. It is importable and picklable (a class, a function, a functools.partial).
SceneFactory = Callable[[], ParticleScene]
# Observed quantity: (scene, theta, equilibrium) -> array, such as a misfit or displacements of points.
Observe = Callable[[Any, FloatArray, Equilibrium], Any]


@dataclass(frozen=True, eq=False)
class Particle:
    """Outcome of one particle.

    theta : (k,) parameters. value : result of `observe`, infinite with shape () where there is no equilibrium. reason :
    why there is none, "" otherwise. factorisations : work done.
    """

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
    """Particles at thetas (m, k), in the given order, solved by the executor's workers
    (`worker.executors.make_executor`).

    start : state from which every block begins, None for the rest state. Results depend neither on the number of
    workers nor on the order of thetas. Raises InputError for a shape other than (m, k).
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
    """Indices (m,) of thetas (m, k) along a nearest-neighbour tour that starts at the lexicographically smallest theta.

    The tour does not depend on the order of thetas.
    """
    if len(thetas) == 0:
        return np.zeros(0, dtype=np.int64)
    dictionary = np.lexsort(thetas.T[::-1])
    points = thetas[dictionary]
    unvisited = np.ones(len(points), dtype=bool)
    walk = [0]
    unvisited[0] = False
    for _ in range(len(points) - 1):
        distance = ((points - points[walk[-1]]) ** 2).sum(axis=1)
        distance[~unvisited] = np.inf
        walk.append(int(np.argmin(distance)))
        unvisited[walk[-1]] = False
    return dictionary[walk]


_SCENE: tuple[str, ParticleScene] | None = None


def _scene(key: str, factory: bytes) -> ParticleScene:
    """This process's scene, built once and replaced when the key changes."""
    global _SCENE
    if _SCENE is None or _SCENE[0] != key:
        _SCENE = None  # frees the memory of the old scene first
        _SCENE = key, pickle.loads(factory)()
    return _SCENE[1]


def _solve_block(block: _Block) -> Sequence[Particle]:
    """Particles of one block. A particle without equilibrium is skipped as a start: the next one starts from the last
    equilibrium.
    """
    scene = _scene(block.key, block.factory)
    state, out = block.start, []
    for theta in block.thetas:
        equilibrium = scene.solve(theta, state, block.options)
        if equilibrium.converged:
            state = State(equilibrium.u, equilibrium.p)
            value = np.asarray(block.observe(scene, theta, equilibrium), dtype=float)
            out.append(Particle(theta, value, "", equilibrium.factorisations))
        else:
            reason = equilibrium.reason or "no equilibrium"
            out.append(Particle(theta, np.array(np.inf), reason, equilibrium.factorisations))
    return out
