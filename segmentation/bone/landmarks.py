"""Where the pelvis lies: its plane of symmetry, the pubic symphysis and the sacrum, all from bone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, optimize

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.segmentation.working_grid import Mask

# Half the width of the band about the midline in which the symphysis and the sacrum are sought.
BAND_MM = 12.0
SMALLEST_PIECE_CC = 0.8
# Bones are mirrored onto themselves this well in a straight pelvis; below, the plane is not to be trusted.
RELIABLE_OVERLAP = 0.55


@dataclass(frozen=True, eq=False)
class Pelvis:
    """Landmarks in LPS mm.

    normal, point : the plane of symmetry; the normal (3,) points to the patient's left. symmetry : share of the bone
    that is mirrored onto bone. symphysis : lowest and highest corner (2, 3) of the pubic bones at the midline.
    sacrum : points (n, 3) of sacrum and coccyx near the midline.
    """

    normal: FloatArray
    point: FloatArray
    symmetry: float
    symphysis: FloatArray
    sacrum: FloatArray

    @property
    def reliable(self) -> bool:
        """Whether the plane of symmetry may be trusted."""
        return self.symmetry >= RELIABLE_OVERLAP

    def midline_x(self, y: float, z: float) -> float:
        """Where the plane of symmetry lies, x mm, at y and z."""
        n, p = self.normal, self.point
        return float(p[0] - (n[1] * (y - p[1]) + n[2] * (z - p[2])) / n[0])


def find_pelvis(bone: Volume) -> Pelvis:
    """Landmarks of a bone mask on an even upright grid.

    Raises InputError when there are no pubic bones at the midline.
    """
    step = float(bone.spacing[0])
    points = bone.to_lps(np.argwhere(bone.array).astype(float))
    if len(points) < 200:
        raise InputError("the scan shows hardly any bone; give a CT that holds the pelvis, or give labels")
    normal, point, symmetry = _symmetry(bone, points)
    away = (points - point) @ normal
    band = np.zeros(bone.array.shape, dtype=bool)
    inside = np.abs(away) < BAND_MM
    band[tuple(np.argwhere(bone.array)[inside].T)] = True
    front, back = _front_and_back(bone, band, step, float(np.median(points[:, 1])))
    return Pelvis(normal, point, symmetry, np.array([front.min(axis=0), front.max(axis=0)]), back)


def _symmetry(bone: Volume, points: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Plane that mirrors the bones best: x at the middle, and its two tilts."""
    soft = ndimage.gaussian_filter(bone.array.astype(np.float32), 4.0 / bone.spacing[0])
    chosen = points[:: max(1, len(points) // 6000)]
    middle = points.mean(axis=0)

    def overlap(x: FloatArray) -> float:
        normal = _normal(x[1], x[2])
        mirrored = chosen - 2.0 * ((chosen - middle - [x[0], 0, 0]) @ normal)[:, None] * normal
        values = ndimage.map_coordinates(soft, bone.to_index(mirrored).T, order=1)
        return -float(values.mean())

    starts = np.arange(-40.0, 41.0, 4.0)
    first = min(starts, key=lambda x: overlap(np.array([x, 0.0, 0.0])))
    simplex = np.array([[first, 0, 0], [first + 4, 0, 0], [first, 0.06, 0], [first, 0, 0.06]])
    best = optimize.minimize(
        overlap, simplex[0], method="Nelder-Mead", options={"initial_simplex": simplex, "maxiter": 120}
    )
    itself = float(ndimage.map_coordinates(soft, bone.to_index(chosen).T, order=1).mean())
    point = middle + np.array([best.x[0], 0.0, 0.0])
    return _normal(best.x[1], best.x[2]), point, -float(best.fun) / max(itself, 1e-6)


def _normal(yaw: float, roll: float) -> FloatArray:
    normal = np.array([1.0, yaw, roll])
    return normal / np.linalg.norm(normal)


def _front_and_back(bone: Volume, band: Mask, step: float, middle_y: float) -> tuple[FloatArray, FloatArray]:
    """Points of the pubic bones and of the sacrum in the midline band (n, 3) mm."""
    parts, count = ndimage.label(band, structure=np.ones((3, 3, 3)))
    front: list[FloatArray] = []
    back: list[FloatArray] = []
    for number in range(1, count + 1):
        index = np.argwhere(parts == number)
        if len(index) * step**3 < SMALLEST_PIECE_CC * 1000.0:
            continue
        points = bone.to_lps(index.astype(float))
        (front if points[:, 1].mean() < middle_y else back).append(points)
    if not front:
        raise InputError("the scan shows no pubic bones at the midline; give a CT that holds them, or give labels")
    sacrum = np.concatenate(back) if back else np.empty((0, 3))
    return max(front, key=len), sacrum
