"""Distance of a figure's rim from a drawn line and of the line from the rim, with derivatives (Eqs 11 to 13 of Yang &
Lin, both ways).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.applications.sketch.figure import Figure
from palpate.applications.sketch.outline import Outline
from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium

# Correlation length of a drawn line's error, in figure sizes.
CORRELATION = 0.04


@dataclass(frozen=True, eq=False)
class Target:
    """One keyframe. outline : as drawn. partners : (q, 2) mm, about where each point of the figure's rim belongs."""

    outline: Outline
    partners: FloatArray


def residual_of(
    figure: Figure, equilibrium: Equilibrium, moves: FloatArray, target: Target, share: float | None, line_error: float
) -> tuple[FloatArray, FloatArray]:
    """Whitened residual (m,) and derivative (m, p) for rim movements (q, 2, p) per parameter.

    share : of the displacement to the partners, point to point; None for the distance between the lines.
    """
    rim = figure.rim_at(equilibrium.u)
    x, size = rim.points, figure.outline.size
    if share is not None:
        goal = figure.outline.points + share * (target.partners - figure.outline.points)
        weight = _weight(len(x), figure.outline.length, size, 2.0 * line_error)
        return weight * (x - goal).ravel(), weight * moves.reshape(-1, moves.shape[2])
    outward = _point_normals(rim)
    segment, _, near = target.outline.nearest(x, outward)
    normal = target.outline.normals[segment]
    ahead = np.einsum("qi,qi->q", normal, x - near), np.einsum("qi,qip->qp", normal, moves)
    y, line = target.outline.points, _point_normals(target.outline)
    own, along, met = rim.nearest(y, line)
    moved = (1.0 - along)[:, None, None] * moves[own] + along[:, None, None] * moves[rim.following[own]]
    back = np.einsum("qi,qi->q", line, met - y), np.einsum("qi,qip->qp", line, moved)
    scale = np.sqrt(0.5)  # both ways look at the same two lines
    weights = [
        scale * _weight(len(p), length, size, line_error)
        for p, length in ((x, figure.outline.length), (y, target.outline.length))
    ]
    residual = np.concatenate([weights[0] * ahead[0], weights[1] * back[0]])
    return residual, np.vstack([weights[0] * ahead[1], weights[1] * back[1]])


def _weight(count: int, length: float, size: float, line_error: float) -> float:
    """Of each of `count` points along a line, so that every correlation length counts as one look."""
    looks = length / (CORRELATION * size)
    return float(np.sqrt(min(1.0, looks / count)) / (line_error * size))


def _point_normals(outline: Outline) -> FloatArray:
    """(n, 2) unit outward normals at points: the mean of the two segments'."""
    total = outline.normals.copy()
    np.add.at(total, outline.following, outline.normals)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300))
