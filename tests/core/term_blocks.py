"""Blocks and walls that terms of the equilibrium are tried on."""

from __future__ import annotations

import numpy as np

from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box
from palpate.core.fem.newton.newton import NewtonOptions
from palpate.core.fem.space import Space
from palpate.core.laws import LINEAR

SIZE = np.array([4.0, 5.0, 6.0])
TIGHT = NewtonOptions(rtol=1e-12)


def without_lateral_strain(E: float) -> Material:
    """Linear law with Poisson ratio 0, so that a pulled block is a bar."""
    return Material(LINEAR, np.array([E / 2.0, E / 3.0]))


def faces_at(space: Space, axis: int, value: float) -> np.ndarray:
    faces, _ = space.mesh.boundary
    return faces[np.isclose(space.mesh.points[faces][:, :, axis], value).all(axis=1)]


def block(element: str, divisions: tuple[int, int, int] = (2, 2, 3)) -> Space:
    return Space.of(box(SIZE, divisions, jitter=0.2, seed=7), element)


def sphere_distance(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance of a ball of radius 7 about (1, 2, -3)."""
    d = x - np.array([1.0, 2.0, -3.0])
    r = np.linalg.norm(d, axis=1)
    return r - 7.0, d / r[:, None]


def held_below(space: Space, components: tuple[int, ...] = (2,)) -> np.ndarray:
    """Free unknowns of a bar that stands on z = 0 and may thin; two more nodes stop its drift and turning."""
    free = np.ones((space.n_nodes, 3), dtype=bool)
    for c in components:
        free[np.isclose(space.nodes[:, 2], 0.0), c] = False
    corner = np.flatnonzero((np.abs(space.nodes) < 1e-9).all(axis=1))
    along_x = np.flatnonzero((np.abs(space.nodes - SIZE * [1, 0, 0]) < 1e-9).all(axis=1))
    free[corner] = False
    free[along_x, 1] = False
    return free.ravel()
