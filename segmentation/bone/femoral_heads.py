"""The femoral heads: balls of bone, found by where the gradients of the picture point (Loy and Zelinsky, PAMI 2003)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, FloatArray
from palpate.imaging.volume import Volume
from palpate.segmentation.bone.landmarks import Pelvis
from palpate.segmentation.methods.star_surface import sphere

SIDES = {"left": 1.0, "right": -1.0}
# Where a head is sought: away from the plane of symmetry, in front of and behind the symphysis, below and above it, mm.
BESIDE_MM, BEFORE_MM, BEHIND_MM, BELOW_MM, ABOVE_MM = (45.0, 140.0), 10.0, 60.0, 15.0, 55.0
RADII_MM = np.arange(18.0, 30.5, 1.0)
# HU between which bone's edges lie; a gradient, HU per voxel, that is an edge, and the most that one counts.
SOFT_HU, DENSE_HU, EDGE, STRONGEST = 0.0, 400.0, 25.0, 80.0
# Edges of a head look at its centre to this cosine and lie this near its surface.
COSINE, NEAR_MM, ROUNDS = 0.9, 3.0, 4
# Share of the ball's directions in which such an edge lies: below, there is no head.
LEAST_SEEN = 0.3


@dataclass(frozen=True, eq=False)
class Head:
    """centre (3,) mm, radius_mm; seen : share of the ball's directions in which the picture shows its surface."""

    centre: FloatArray
    radius_mm: float
    seen: float


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edge points (n, 3) mm, unit directions (n, 3) towards denser bone, and weights (n,)."""

    points: FloatArray
    inward: FloatArray
    weight: FloatArray

    def towards(self, centre: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Distances (n,) mm to a centre, and which edges look at it."""
        away = centre - self.points
        far = np.linalg.norm(away, axis=1)
        return far, np.einsum("ij,ij->i", away, self.inward) > COSINE * far


def find_heads(hu: Volume, pelvis: Pelvis) -> dict[str, Head]:
    """Side ("left", "right") -> head, as far as the scan (HU, even upright grid of about 2 mm) shows them.

    Both heads of a person are of one size: the radius is found from both together, so that an acetabulum is not taken
    for its head.
    """
    step = float(hu.spacing[0])
    edges = {side: _edges(part) for side, sign in SIDES.items() if (part := _region(hu, pelvis, sign)) is not None}
    centres = {side: _most_voted(found, step) for side, found in edges.items() if len(found.points)}
    for _ in range(ROUNDS if centres else 0):
        radius = _shared_radius([(edges[side], centre) for side, centre in centres.items()])
        centres = {side: _fitted(edges[side], centre, radius) for side, centre in centres.items()}
    heads = {side: Head(c, radius, _seen(edges[side], c, radius)) for side, c in centres.items()}
    return {side: head for side, head in heads.items() if head.seen > LEAST_SEEN}


def _region(hu: Volume, pelvis: Pelvis, sign: float) -> Volume | None:
    """The part of the scan in which one head is sought; None where the scan does not reach there."""
    front = pelvis.symphysis
    middle = pelvis.midline_x(front[1, 1] + 0.5 * BEHIND_MM, float(front[:, 2].mean()))
    across = sorted(middle + sign * x for x in BESIDE_MM)
    low = np.array([across[0], front[0, 1] - BEFORE_MM, front[0, 2] - BELOW_MM])
    high = np.array([across[1], front[1, 1] + BEHIND_MM, front[1, 2] + ABOVE_MM])
    first = np.clip(np.floor(hu.to_index(low[None])[0]).astype(int), 0, None)
    last = np.minimum(np.ceil(hu.to_index(high[None])[0]).astype(int) + 1, hu.array.shape)
    if (last - first < 8).any():
        return None
    affine = hu.affine.copy()
    affine[:3, 3] = hu.to_lps(first[None].astype(float))[0]
    return Volume(hu.array[tuple(slice(a, b) for a, b in zip(first, last, strict=True))], affine)


def _edges(part: Volume) -> _Edges:
    values = np.clip(part.array, SOFT_HU, DENSE_HU).astype(np.float32)
    slope = np.stack(
        [ndimage.gaussian_filter(values, 1.0, order=[int(i == a) for i in range(3)]) for a in range(3)], -1
    )
    size = np.linalg.norm(slope, axis=-1)
    edge = size > EDGE
    points = part.to_lps(np.argwhere(edge).astype(float))
    return _Edges(points, slope[edge] / size[edge][:, None], np.minimum(size[edge], STRONGEST).astype(np.float64))


def _most_voted(edges: _Edges, step: float) -> FloatArray:
    """The place (3,) mm that most edges look at from the distance of some radius."""
    low = edges.points.min(axis=0) - RADII_MM[-1]
    shape = np.ceil((np.ptp(edges.points, axis=0) + 2.0 * RADII_MM[-1]) / step).astype(int) + 1
    votes = np.zeros(shape)
    for radius in RADII_MM:
        index = np.rint((edges.points + radius * edges.inward - low) / step).astype(int)
        # The larger the ball, the more edges it has: votes count by the share of its surface.
        np.add.at(votes, tuple(index.T), edges.weight / radius**2)
    votes = ndimage.gaussian_filter(votes, 3.0 / step)
    return np.asarray(low + step * np.array(np.unravel_index(votes.argmax(), votes.shape)), dtype=np.float64)


def _shared_radius(found: list[tuple[_Edges, FloatArray]]) -> float:
    bins = np.append(RADII_MM - 0.5, RADII_MM[-1] + 0.5)
    votes = np.zeros(len(RADII_MM))
    for edges, centre in found:
        far, looks = edges.towards(centre)
        weight = (edges.weight / np.maximum(far, 1.0) ** 2)[looks]
        votes += ndimage.gaussian_filter1d(np.histogram(far[looks], bins, weights=weight)[0], 1.0)
    return float(RADII_MM[votes.argmax()])


def _fitted(edges: _Edges, centre: FloatArray, radius: float) -> FloatArray:
    """The centre (3,) mm of the ball that fits the edges near a radius best (weighted least squares)."""
    far, looks = edges.towards(centre)
    near = looks & (np.abs(far - radius) < NEAR_MM)
    if near.sum() < 50:
        return centre
    points, root = edges.points[near] - centre, np.sqrt(edges.weight[near])[:, None]
    matrix = np.column_stack([2.0 * points, np.ones(len(points))])
    found = np.linalg.lstsq(matrix * root, (points**2).sum(axis=1) * root[:, 0], rcond=None)[0]
    return np.asarray(centre + np.clip(found[:3], -NEAR_MM, NEAR_MM))


def _seen(edges: _Edges, centre: FloatArray, radius: float) -> float:
    """Share of directions from the centre in which an edge that looks at it lies near the ball's surface."""
    far, looks = edges.towards(centre)
    near = looks & (np.abs(far - radius) < NEAR_MM)
    seen = np.zeros(len(sphere().points), dtype=bool)
    away = (edges.points[near] - centre) / far[near][:, None]
    seen[np.argmax(away @ sphere().points.T, axis=1)] = True
    # Voxels of 2 mm reach some two thirds of the 642 directions at once: their neighbours count as seen.
    return float((sphere().mean_of_neighbours @ seen.astype(float) > 0.3).mean()) if near.any() else 0.0
