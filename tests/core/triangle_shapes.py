"""Triangle surfaces with known geometry for tests."""

from __future__ import annotations

import numpy as np

from palpate.core.problem import Surface


def icosphere(levels: int, radii=(1.0, 1.0, 1.0), centre=(0.0, 0.0, 0.0)):
    """A subdivided icosahedron, its points on the unit sphere, then stretched: points (n, 3), outward faces (f, 3)."""
    t = (1 + 5**0.5) / 2
    p = np.array([[-1, t, 0], [1, t, 0], [-1, -t, 0], [1, -t, 0], [0, -1, t], [0, 1, t]], dtype=float)
    p = np.vstack([p, [[0, -1, -t], [0, 1, -t], [t, 0, -1], [t, 0, 1], [-t, 0, -1], [-t, 0, 1]]])
    f = np.array(
        [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6]]
        + [[7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10]]
        + [[8, 6, 7], [9, 8, 1]]
    )
    p /= np.linalg.norm(p, axis=1, keepdims=True)
    for _ in range(levels):
        ends, inverse = np.unique(
            np.sort(f[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), 1), axis=0, return_inverse=True
        )
        a, b, c = (inverse.reshape(-1, 3) + len(p)).T
        p = np.vstack([p, p[ends].mean(axis=1)])
        p /= np.linalg.norm(p, axis=1, keepdims=True)
        f = np.vstack([np.c_[f[:, 0], a, c], np.c_[f[:, 1], b, a], np.c_[f[:, 2], c, b], np.c_[a, b, c]])
    return p * np.asarray(radii) + np.asarray(centre), f


def box(low, high):
    """The twelve outward triangles of a box: points (8, 3), faces (12, 3)."""
    corner = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    return np.asarray(low) + corner * (np.asarray(high) - np.asarray(low)), faces


def tube(radius: float, length: float, around: int, along: int):
    """An open cylinder about z from z = 0 to z = length, normals away from the axis: points, faces."""
    angle = 2 * np.pi * np.arange(around) / around
    z = np.linspace(0.0, length, along + 1)
    p = np.stack([np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(around, h)], 1) for h in z])
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = a + around, b + around
    return p.reshape(-1, 3), np.vstack([np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])


def ball(radius: float, centre: tuple[float, float, float]) -> Surface:
    """A bone beside the body."""
    u, v = np.linspace(0.0, np.pi, 20), np.linspace(0.0, 2.0 * np.pi, 41)[:-1]
    a, b = np.meshgrid(u, v, indexing="ij")
    X = np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)], axis=-1) * [
        radius,
        0.7 * radius,
        1.2 * radius,
    ]
    index = np.arange(a.size).reshape(a.shape)
    right = np.roll(index, -1, axis=1)
    quads = np.stack([index[:-1], index[1:], right[1:], right[:-1]], axis=-1).reshape(-1, 4)
    faces = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Surface(X.reshape(-1, 3) + centre, faces, np.full(len(faces), 4))
