"""The voxels of a slice that lie within a drawn outline, for lasso and polygon."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.path import Path as Outline

from palpate.core.arrays import IntArray
from palpate.imaging.volume import Volume
from palpate.ui.pictures.planes import Plane


def within_outline(volume: Volume, points: Sequence[tuple[float, float, float]], plane: Plane) -> IntArray:
    """Flat indices of the voxels of the slice through the points (mm) whose centres lie within their closed outline."""
    drawn = np.array(points, dtype=np.float64)
    index = volume.to_index(drawn)
    shape = np.array(volume.array.shape)
    low = np.clip(np.floor(index.min(axis=0)).astype(int) - 1, 0, shape)
    high = np.clip(np.ceil(index.max(axis=0)).astype(int) + 2, 0, shape)
    grids = np.meshgrid(*(np.arange(a, b) for a, b in zip(low, high, strict=True)), indexing="ij")
    voxels = np.stack([g.ravel() for g in grids], axis=1)
    centres = volume.to_lps(voxels.astype(float))
    # The slice that is shown: voxels whose centres lie within half a voxel of it.
    reach = 0.5 * float(np.abs(volume.affine[plane.normal, :3]).max())
    away = centres[:, plane.normal] - drawn[0, plane.normal]
    flat = [plane.across, plane.down]
    inside = (away >= -reach) & (away < reach)
    inside[inside] = Outline(drawn[:, flat]).contains_points(centres[inside][:, flat])
    return np.ravel_multi_index(tuple(voxels[inside].T), volume.array.shape)
