"""Which cells of the mesher's box are kept, and what lies behind each boundary face."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.mesh import FACES_OF_CELL
from palpate.imaging.labels import ORGAN_LABELS, OUTSIDE, SURROUNDING_TISSUE
from palpate.meshing.partition import HOLE_NAMES, Partition

KEPT = (*ORGAN_LABELS, SURROUNDING_TISSUE)
# Barycentric points at which a cell is asked what it is: its centroid and four towards the corners.
ASKED = np.vstack([np.full((1, 4), 0.25), 0.15 + 0.4 * np.eye(4)])


def label_cells(points: FloatArray, cells: IntArray, partition: Partition) -> IntArray:
    """The label (m,) that most of five points of each cell have."""
    corners = points[cells]
    votes = np.stack([partition.classify(np.einsum("j,mjk->mk", w, corners)) for w in ASKED])
    counts = np.stack([(votes == label).sum(axis=0) for label in range(7)])
    # The centroid decides a tie.
    counts[votes[0], np.arange(len(cells))] += 1
    return np.asarray(counts.argmax(axis=0), dtype=np.int64)


def face_neighbours(cells: IntArray) -> IntArray:
    """The cell (m, 4) across the face opposite to each vertex, -1 where there is none."""
    faces = np.sort(cells[:, FACES_OF_CELL].reshape(-1, 3), axis=1)
    order = np.lexsort(faces.T)
    same = (faces[order][1:] == faces[order][:-1]).all(axis=1)
    first, second = order[:-1][same], order[1:][same]
    across = np.full(len(faces), -1)
    across[first], across[second] = second // 4, first // 4
    return across.reshape(-1, 4)


def parts_of(across: IntArray, member: BoolArray) -> IntArray:
    """Number of the face-connected part (m,) that each member cell belongs to, -1 for others; 0 is the largest."""
    own = np.repeat(np.arange(len(across)), 4)
    other = across.ravel()
    joined = (other >= 0) & member[own] & member[other]
    graph = coo_array((np.ones(joined.sum()), (own[joined], other[joined])), shape=(len(across),) * 2)
    _, part = connected_components(graph, directed=False)
    sizes = np.bincount(part[member], minlength=part.max() + 1)
    rank = np.empty_like(sizes)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    return np.where(member, rank[part], -1)


def clean_labels(cells: IntArray, labels: IntArray, n_points: int) -> IntArray:
    """Labels (m,) such that the kept cells and each organ region are in one piece, without hinges.

    A loose part of an organ region becomes what most of its neighbours are. Loose tissue, and tissue that hangs on by
    an edge or a point only, is given to the hole or outside it lies in.
    """
    labels = labels.copy()
    across = face_neighbours(cells)
    for region in ORGAN_LABELS:
        loose = parts_of(across, labels == region) > 0
        _give_to_neighbours(labels, across, loose, [i for i in KEPT if i != region])
    holes = [*HOLE_NAMES, OUTSIDE]
    for _ in range(10):
        kept = np.isin(labels, KEPT)
        loose = parts_of(across, kept) > 0
        if not loose.any():
            loose = (labels == SURROUNDING_TISSUE) & _hinged(cells, across, kept, n_points)
        if not loose.any():
            break
        _give_to_neighbours(labels, across, loose, holes)
    return labels


def _hinged(cells: IntArray, across: IntArray, kept: BoolArray, n_points: int) -> BoolArray:
    """Kept cells that belong, at one of their points, to a group that no face joins to the larger group there."""
    corner_point = cells.ravel()
    corner_cell = np.repeat(np.arange(len(cells)), 4)
    # Two corners are joined when their cells share a face that has the point.
    own = np.flatnonzero(kept[corner_cell])
    links_a, links_b = [], []
    for turn in (1, 2, 3):
        vertex = own % 4
        other = across[corner_cell[own], (vertex + turn) % 4]
        ok = (other >= 0) & kept[other]
        source, target = own[ok], other[ok]
        slot = (cells[target] == corner_point[source][:, None]).argmax(axis=1)
        links_a.append(source)
        links_b.append(4 * target + slot)
    a, b = np.concatenate(links_a), np.concatenate(links_b)
    _, group = connected_components(
        coo_array((np.ones(len(a)), (a, b)), shape=(len(corner_point),) * 2), directed=False
    )
    size = np.bincount(group[own], minlength=group.max() + 1)
    largest = np.zeros(n_points, dtype=np.int64)
    np.maximum.at(largest, corner_point[own], group[own] + (size[group[own]].astype(np.int64) << 32))
    minor = np.zeros(len(cells), dtype=bool)
    minor[corner_cell[own[group[own] != (largest[corner_point[own]] & 0xFFFFFFFF)]]] = True
    return minor


def _give_to_neighbours(labels: IntArray, across: IntArray, loose: BoolArray, allowed: list[int]) -> None:
    """Relabel loose cells, from their rim inward, as the commonest allowed label across their faces."""
    left = loose.copy()
    while left.any():
        ids = np.flatnonzero(left)
        beside = across[ids]
        usable = (beside >= 0) & ~left[beside] & np.isin(labels[beside], allowed)
        counts = np.stack([(usable & (labels[beside] == label)).sum(axis=1) for label in allowed], axis=1)
        ready = counts.max(axis=1) > 0
        if not ready.any():
            labels[ids] = OUTSIDE
            return
        labels[ids[ready]] = np.array(allowed)[counts[ready].argmax(axis=1)]
        left[ids[ready]] = False
