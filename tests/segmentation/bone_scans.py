"""An asymmetric pelvis of simple shapes as CT, and the same after a known rigid motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from palpate.imaging.volume import Volume

# (centre, half axes) mm of ellipsoids of bone; no symmetry between left and right.
_BONES = [
    ((-52.0, 4.0, 0.0), (14.0, 20.0, 34.0)),
    ((57.0, -3.0, 6.0), (16.0, 15.0, 30.0)),
    ((3.0, 44.0, 12.0), (30.0, 9.0, 24.0)),
    ((-6.0, -38.0, -14.0), (26.0, 8.0, 11.0)),
]


def moving(angles: tuple[float, float, float], shift: tuple[float, float, float]) -> NDArray[np.float64]:
    """A rigid transform (4, 4): angles in degrees about x, y, z, then a shift in mm."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    matrix[:3, 3] = shift
    return matrix


def scan(
    to_rest: NDArray[np.float64] | None = None, leg_shift: float = 0.0, noise: float = 15.0, lowest: float = -48.0
) -> Volume:
    """A CT (HU) whose points p show what the body at rest has at ``to_rest`` p.

    leg_shift : mm by which the bone on the left has moved back by itself. lowest : where the scan begins, mm in z.
    """
    affine = np.diag([2.5, 2.5, 3.0, 1.0])
    affine[:3, 3] = [-90.0, -70.0, lowest]
    shape = (73, 57, int((51.0 - lowest) / 3.0))
    volume = Volume(np.zeros(shape, dtype=np.int16), affine)
    points = volume.to_lps(np.argwhere(np.ones(shape, dtype=bool)).astype(float))
    if to_rest is not None:
        points = points @ to_rest[:3, :3].T + to_rest[:3, 3]
    density = np.full(len(points), 40.0)
    for index, (centre, half) in enumerate(_BONES):
        moved = np.array(centre) + (np.array([0.0, leg_shift, 0.0]) if index == 1 else 0.0)
        inside = 1.0 - np.linalg.norm((points - moved) / np.array(half), axis=1)
        # A blurred edge about 2 mm wide, as a scanner makes it.
        density += 700.0 / (1.0 + np.exp(-inside * min(half) / 1.0))
    density += np.random.default_rng(1).normal(0.0, noise, len(points))
    return volume.with_array(np.rint(density).astype(np.int16).reshape(shape))


def bone_labels(ct: Volume) -> Volume:
    """The label volume (bone 4, tissue 3) that a person would draw on such a CT."""
    return ct.with_array(np.where(ct.array > 390, 4, 3).astype(np.uint8))


def largest_error(found: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """The largest distance, mm, between what two rigid transforms do to the pelvis."""
    corners = np.array([[x, y, z, 1.0] for x in (-70, 75) for y in (-50, 55) for z in (-35, 45)])
    return float(np.linalg.norm((corners @ (found - truth).T)[:, :3], axis=1).max())
