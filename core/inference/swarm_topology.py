"""Who informs whom in a particle swarm: the adaptive random topology (Clerc; section 3.2.6 of Yang & Lin)."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray, IntArray


def draw_informants(rng: np.random.Generator, particles: int, informed: int) -> BoolArray:
    """Matrix (M, M), [i, j] true where particle j informs particle i.

    The paper says that i gets K random neighbours; in the scheme it takes this from, each particle informs itself and K
    particles drawn with replacement, so that the number of informants varies: 1 + Binomial(M - 1, 1 - (1 - 1/M)^K).
    """
    informs = np.eye(particles, dtype=bool)
    targets = rng.integers(0, particles, size=(particles, informed))
    informs[targets, np.arange(particles)[:, None]] = True
    return informs


def neighbourhood_best(informs: BoolArray, values: FloatArray) -> IntArray:
    """Index (M,) of each particle's best informant; the particle itself where it is as good as any."""
    heard = np.where(informs, values[None, :], np.inf)
    best = np.argmin(heard, axis=1)
    own = np.arange(len(values))
    return np.where(values <= heard[own, best], own, best)
