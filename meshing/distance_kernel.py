"""Compiled signed distance of a voxel mask, cut off at a few voxels: no more is looked at than that."""

from __future__ import annotations

import numpy as np
from numba import njit

from palpate.core.arrays import FloatArray, NumberArray

# More than any squared distance, mm2.
_FAR = 1e30


@njit(cache=True, error_model="numpy")
def clipped_signed_distance(mask: NumberArray, spacing: FloatArray, half: float, clip: float, out: FloatArray) -> None:
    """Fill out (ni, nj, nk) mm with the distance of each voxel's centre to the nearest one of the other value less `half`,
    positive where the mask (ni, nj, nk) of 0 and 1 is 1, cut off at `clip`.

    Squares add up axis by axis (Felzenszwalb & Huttenlocher 2012), of all voxels in reach instead of by envelopes.
    """
    reach = (clip + half) ** 2
    for value in range(2):
        first = _along_first(mask, value, spacing[0])
        for i in range(mask.shape[0]):
            plane = _along_second(first[i], mask[i], value, spacing[1], clip + half)
            for j in range(mask.shape[1]):
                if (mask[i, j] != value).any():
                    row = _along_third(plane[j], spacing[2], clip + half)
                    for k in range(mask.shape[2]):
                        if mask[i, j, k] != value:
                            away = clip if row[k] >= reach else min(np.sqrt(row[k]) - half, clip)
                            out[i, j, k] = -away if value == 1 else away


@njit(cache=True, error_model="numpy")
def _along_first(mask: NumberArray, value: int, step: float) -> FloatArray:
    """Squared distance (ni, nj, nk) mm2 to the nearest voxel of that value along the first axis."""
    ni, nj, nk = mask.shape
    out = np.empty((ni, nj, nk))
    for way in range(2):
        last = np.full((nj, nk), -1)
        for n in range(ni):
            i = n if way == 0 else ni - 1 - n
            for j in range(nj):
                for k in range(nk):
                    if mask[i, j, k] == value:
                        last[j, k] = i
                    away = (last[j, k] - i) * step
                    square = _FAR if last[j, k] < 0 else away * away
                    out[i, j, k] = square if way == 0 else min(square, out[i, j, k])
    return out


@njit(cache=True, error_model="numpy")
def _along_second(first: FloatArray, mask: NumberArray, value: int, step: float, reach: float) -> FloatArray:
    """The least (nj, nk) of squared distances (nj, nk) and what a way along the first of these axes adds, where asked for."""
    nj, nk = first.shape
    out = np.full((nj, nk), _FAR)
    for j in range(nj):
        if (mask[j] != value).any():
            row = out[j]
            for other in range(max(0, j - int(reach / step)), min(nj, j + int(reach / step) + 1)):
                away = (other - j) * step
                for k in range(nk):
                    square = first[other, k] + away * away
                    row[k] = square if square < row[k] else row[k]
    return out


@njit(cache=True, error_model="numpy")
def _along_third(row: FloatArray, step: float, reach: float) -> FloatArray:
    """The same (nk,) along a row (nk,)."""
    n, out = len(row), row.copy()
    for lag in range(1, min(n - 1, int(reach / step)) + 1):
        square = (lag * step) ** 2
        for k in range(n - lag):
            out[k] = min(out[k], row[k + lag] + square)
            out[k + lag] = min(out[k + lag], row[k] + square)
    return out
