"""Were the contours of the two scans exchanged? The scans themselves tell: an organ is of one grey."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import ndimage

from palpate.case.case_folder import STATES
from palpate.core.arrays import FloatArray
from palpate.core.surfaces.rigid_motion import transformed
from palpate.imaging.labels import BLADDER, ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume

# Gas, contrast and metal say nothing of how well an outline lies.
_LOW_HU, _HIGH_HU = -150.0, 250.0
_MOST_VOXELS = 20_000
# Fewer voxels in which the two outlines differ tell nothing.
_LEAST_VOXELS = 200
# Where the outlines differ, the other scan must look more like the organ than the outline's own, by this share in both states.
_BETTER = 0.9
# Not the rectum: what fills it is of every grey. But its gas is never outside an outline of the scan that shows it.
_GROUPS = (ORGAN_LABELS, (BLADDER,))
# Seen: 0 and 0.08 with right contours, 0.26 and 0.38 with exchanged ones.
_GAS_HU, _MUCH_GAS = -300.0, 0.2


def swapped_note(scans: Mapping[str, Volume], labels: Mapping[str, Volume], deformed_to_rest: FloatArray) -> str | None:
    """A warning when each scan's grey values fit the other scan's contours better than its own; else None.

    Judged where the outlines differ: what only the rest contours call bladder must look like bladder in the scan at rest, and
    not in the other; and a scan's own contours of the rectum must hold its gas. scans, labels : by state, HU and label values, each in
    its own scan's patient coordinates (LPS, mm).
    deformed_to_rest (4, 4). None also where only one state has contours, or where they hardly differ.
    """
    if not all(state in labels for state in STATES):
        return None
    to_other: dict[str, FloatArray] = {
        "rest": np.linalg.inv(deformed_to_rest).astype(np.float64),
        "deformed": deformed_to_rest,
    }
    found = [_where_they_differ(scans, labels, s, to_other[s[0]]) for s in (STATES, STATES[::-1])]
    distances = [pair for pair in found if pair is not None]
    greys = distances and all(there < _BETTER * here for here, there in distances)
    gas = any(_gas_left_out(scans, labels, s, to_other[s[1]]) > _MUCH_GAS for s in (STATES, STATES[::-1]))
    if greys or gas:
        return (
            "the contours look exchanged: where they differ, each scan's grey values fit the other scan's contours better; "
            "check which labels belong to the scan at rest and which to the deformed one"
        )
    return None


def _where_they_differ(
    scans: Mapping[str, Volume], labels: Mapping[str, Volume], states: tuple[str, str], matrix: FloatArray
) -> tuple[float, float] | None:
    """Mean distance from the organ's grey, HU, in the outline's own scan and in the other, over voxels that only it names."""
    state, other = states
    here, there, count = 0.0, 0.0, 0
    for group in _GROUPS:
        voxels = np.argwhere(np.isin(labels[state].array, group))
        voxels = voxels[:: max(1, len(voxels) // _MOST_VOXELS)]
        if not len(voxels) or not np.isin(labels[other].array, group).any():
            continue
        points = labels[state].to_lps(voxels.astype(float))
        moved = transformed(matrix, points)
        alone = ~np.isin(_at(labels[other], moved, 0.0), group)
        if alone.all() or alone.sum() < _LEAST_VOXELS:
            continue
        own, crossed = _at(scans[state], points, _LOW_HU), _at(scans[other], moved, _LOW_HU)
        # Each scan has its own grey of an organ, by its contrast agent and its noise.
        here += float(np.abs(own[alone] - np.median(own[~alone])).sum())
        there += float(np.abs(crossed[alone] - np.median(crossed[~alone])).sum())
        count += int(alone.sum())
    return (here / count, there / count) if count else None


def _gas_left_out(
    scans: Mapping[str, Volume], labels: Mapping[str, Volume], states: tuple[str, str], matrix: FloatArray
) -> float:
    """The share of gas in a scan where only the other's contours see the rectum; 0 where those hardly differ. matrix : from the other."""
    state, other = states
    voxels = np.argwhere(labels[other].array == RECTUM)
    if not len(voxels) or not (labels[state].array == RECTUM).any():
        return 0.0
    voxels = voxels[:: max(1, len(voxels) // _MOST_VOXELS)]
    points = transformed(matrix, labels[other].to_lps(voxels.astype(float)))
    alone = points[_at(labels[state], points, 0.0) != RECTUM]
    if len(alone) < _LEAST_VOXELS:
        return 0.0
    found = ndimage.map_coordinates(
        scans[state].array, scans[state].to_index(alone).T, order=0, mode="constant", cval=0.0
    )
    return float((found < _GAS_HU).mean())


def _at(volume: Volume, points: FloatArray, outside: float) -> FloatArray:
    """Values of the nearest voxels, cut to what tells organs apart."""
    found = ndimage.map_coordinates(volume.array, volume.to_index(points).T, order=0, mode="constant", cval=outside)
    return np.clip(found.astype(float), _LOW_HU, _HIGH_HU)
