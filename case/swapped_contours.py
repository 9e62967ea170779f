"""Check for exchanged contours: whether each scan's grey values fit the other scan's contours better."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import ndimage

from palpate.case.case_folder import STATES
from palpate.core.arrays import FloatArray
from palpate.core.surfaces.rigid_motion import transformed
from palpate.imaging.labels import BLADDER, ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume

# Range of HU that is compared; gas, contrast and metal beyond it say nothing about the fit of a contour.
_LOW_HU, _HIGH_HU = -150.0, 250.0
# Largest number of voxels of a structure that are sampled.
_MOST_VOXELS = 20_000
# Smallest number of voxels in which the contours of the two scans must differ for a comparison.
_LEAST_VOXELS = 200
# Ratio of the grey-value distances, other scan to own scan, below which contours look exchanged; required in both
# states.
_BETTER = 0.9
# Structures of nearly one grey value. The rectum is not one: its content has all of them, so only its gas is used.
_GROUPS = (ORGAN_LABELS, (BLADDER,))
# Gas is below this HU; its share above this looks exchanged. Measured shares: 0 and 0.08 right, 0.26 and 0.38
# exchanged.
_GAS_HU, _MUCH_GAS = -300.0, 0.2


def swapped_note(scans: Mapping[str, Volume], labels: Mapping[str, Volume], deformed_to_rest: FloatArray) -> str | None:
    """Warning when each scan's grey values fit the other scan's contours better than its own; else None.

    scans, labels : CT (HU) and label volume by state, each in its own scan's patient coordinates (LPS, mm).
    deformed_to_rest : (4, 4) rigid transform, mm. Only voxels where the two sets of contours differ are compared.
    Voxels that only the rest contours call bladder must look like bladder at rest and not in the deformed scan. A
    scan's own contours of the rectum must contain its gas. None also where one state has no contours, or where they
    hardly differ.
    """
    if not all(state in labels for state in STATES):
        return None
    to_other: dict[str, FloatArray] = {
        "rest": np.linalg.inv(deformed_to_rest).astype(np.float64),
        "deformed": deformed_to_rest,
    }
    compared = [_grey_distances(scans, labels, s, to_other[s[0]]) for s in (STATES, STATES[::-1])]
    distances = [pair for pair in compared if pair is not None]
    greys = distances and all(there < _BETTER * here for here, there in distances)
    gas = any(_gas_outside_contour(scans, labels, s, to_other[s[1]]) > _MUCH_GAS for s in (STATES, STATES[::-1]))
    if greys or gas:
        return (
            "the contours look exchanged: where they differ, each scan's grey values fit the other scan's contours better; "
            "check which labels belong to the scan at rest and which to the deformed one"
        )
    return None


def _grey_distances(
    scans: Mapping[str, Volume], labels: Mapping[str, Volume], states: tuple[str, str], matrix: FloatArray
) -> tuple[float, float] | None:
    """Mean distance from an organ's median grey value, HU, in the own scan and in the other scan; None without data.

    Both means run over the voxels that only `states[0]` calls the organ. matrix : (4, 4), own frame to the other's.
    """
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
        # Medians are taken per scan: contrast agent and noise shift the grey value of an organ.
        here += float(np.abs(own[alone] - np.median(own[~alone])).sum())
        there += float(np.abs(crossed[alone] - np.median(crossed[~alone])).sum())
        count += int(alone.sum())
    return (here / count, there / count) if count else None


def _gas_outside_contour(
    scans: Mapping[str, Volume], labels: Mapping[str, Volume], states: tuple[str, str], matrix: FloatArray
) -> float:
    """Share of gas in a scan's voxels that only the other scan's contours call rectum; 0 where the contours hardly
    differ.

    matrix : (4, 4), the other scan's frame to the frame of `states[0]`.
    """
    state, other = states
    voxels = np.argwhere(labels[other].array == RECTUM)
    if not len(voxels) or not (labels[state].array == RECTUM).any():
        return 0.0
    voxels = voxels[:: max(1, len(voxels) // _MOST_VOXELS)]
    points = transformed(matrix, labels[other].to_lps(voxels.astype(float)))
    alone = points[_at(labels[state], points, 0.0) != RECTUM]
    if len(alone) < _LEAST_VOXELS:
        return 0.0
    greys = ndimage.map_coordinates(
        scans[state].array, scans[state].to_index(alone).T, order=0, mode="constant", cval=0.0
    )
    return float((greys < _GAS_HU).mean())


def _at(volume: Volume, points: FloatArray, outside: float) -> FloatArray:
    """Values of the nearest voxels at points (n, 3), LPS mm, clipped to the compared range of HU; `outside` beyond the
    volume.
    """
    values = ndimage.map_coordinates(volume.array, volume.to_index(points).T, order=0, mode="constant", cval=outside)
    return np.clip(values.astype(float), _LOW_HU, _HIGH_HU)
