"""What hidden effects draw at random."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray
from palpate.validate.blind.simulator.simulated_body import Simulated


def either(size: float, rng: np.random.Generator) -> float:
    """size or its inverse."""
    return float(size if rng.random() < 0.6 else 1.0 / size)


def sign(rng: np.random.Generator) -> float:
    """1 or -1."""
    return float(rng.choice([-1.0, 1.0]))


def direction(rng: np.random.Generator) -> tuple[float, float, float]:
    """A unit vector, all directions alike."""
    a = rng.standard_normal(3)
    a /= np.linalg.norm(a)
    return float(a[0]), float(a[1]), float(a[2])


def ball(s: Simulated, rng: np.random.Generator, label: int) -> tuple[BoolArray, FloatArray]:
    """A place in one half: cells (m,) of bool within a sharp edge, and its centre."""
    centre = s.centres[s.body.regions == label].mean(axis=0) + rng.uniform(-4.0, 4.0, 3)
    inside = np.linalg.norm(s.centres - centre, axis=1) < rng.uniform(6.5, 9.5)
    return inside & (s.body.regions == label), centre
