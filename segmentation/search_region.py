"""What every organ is sought in: the CT on one even grid about the pelvis, its bones and landmarks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import Float32Array, FloatArray
from palpate.imaging.volume import Volume
from palpate.segmentation.bone.landmarks import Pelvis
from palpate.segmentation.hu_scale import rescaled
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.whole_scan import WholeScan, whole_scan
from palpate.segmentation.working_grid import (
    FINE_MM,
    HIGH_HU,
    LOW_HU,
    Mask,
    bounds,
    gas_filled,
    mask_on,
    resampled,
    upright,
)

# Room about the landmarks, mm: to both sides of the midline, in front of and behind the symphysis, below and above it.
BESIDE, BEFORE, BEHIND, BELOW, ABOVE = 80.0, 25.0, 125.0, 50.0, 95.0
ROOM_ABOUT_PROMPTS = 60.0


@dataclass(frozen=True, eq=False)
class Found:
    """An organ as found. mask : on the scene's grid. method : auto, carried, click, box, extremes, propagated
    or user.

    confidence : 0 to 1, how well picture and anatomy support it. notes : what a person should look at.
    """

    mask: Mask
    method: str
    confidence: float
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Scene:
    """The CT ready for segmentation; all arrays on ``grid``.

    grid : even and upright. hu : HU by the scan's own fat (hu_scale.py), cut to LOW_HU..HIGH_HU. filled : the same with gas
    as soft tissue. gas, body, bone : masks. whole_bone, whole_hu : bone and HU of the whole scan on a 2 mm grid. fat,
    muscle : typical HU of this scan.
    """

    grid: Volume
    hu: Float32Array
    filled: Float32Array
    gas: Mask
    body: Mask
    bone: Mask
    pelvis: Pelvis
    whole_bone: Volume
    whole_hu: Volume
    fat: float
    muscle: float

    @property
    def step(self) -> float:
        """Spacing of the grid, mm."""
        return float(self.grid.spacing[0])

    @property
    def soft_tissue(self) -> Volume:
        """`filled` with its grid."""
        return self.grid.with_array(self.filled)

    @property
    def fat_edge(self) -> float:
        """HU half-way from fat to soft tissue: where a boundary against fat lies."""
        return 0.5 * (self.fat + 40.0)

    def axes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coordinates x, y, z of the grid, shaped to broadcast over it."""
        origin, shape = self.grid.affine[:3, 3], self.grid.array.shape
        x, y, z = (origin[i] + self.step * np.arange(shape[i]) for i in range(3))
        return x[:, None, None], y[None, :, None], z[None, None, :]

    def index(self, point: FloatArray) -> tuple[int, int, int]:
        """The voxel nearest a point (3,) mm, moved onto the grid where it lies beyond."""
        nearest = np.rint(self.grid.to_index(np.asarray(point)[None])[0]).astype(int)
        i, j, k = np.clip(nearest, 0, np.array(self.grid.array.shape) - 1)
        return int(i), int(j), int(k)

    def box_mask(self, box: FloatArray, margin_mm: float) -> Mask:
        """Voxels within a box (2, 3) mm and a margin."""
        inside = np.ones(self.grid.array.shape, dtype=bool)
        for axis, coordinate in enumerate(self.axes()):
            inside &= (coordinate > box[0, axis] - margin_mm) & (coordinate < box[1, axis] + margin_mm)
        return inside

    def part(self, box: FloatArray, margin_mm: float) -> tuple[slice, ...]:
        """The part of the grid that holds a box (2, 3) mm and a margin."""
        low, high = self.index(box[0] - margin_mm), self.index(box[1] + margin_mm)
        return tuple(slice(a, b + 1) for a, b in zip(low, high, strict=True))

    def cc(self, mask: Mask) -> float:
        """Volume of a mask, cc."""
        return float(mask.sum()) * self.step**3 / 1000.0


def make_scene(
    ct: Volume, prompts: Prompts | None = None, step_mm: float = FINE_MM, whole: WholeScan | None = None
) -> Scene:
    """Bodies, bones and landmarks of a CT (HU, any grid), and the part of it about the prostate, evenly sampled.

    whole : what `whole_scan` found of this CT, where it was asked before.

    Raises InputError when the scan holds no body or no pubic bones.
    """
    whole = whole or whole_scan(ct)
    pelvis, scale = whole.pelvis, whole.scale
    grid = upright(*_region(ct, pelvis, prompts or Prompts()), step_mm)
    hu = np.clip(rescaled(resampled(ct, grid).array, scale), LOW_HU, HIGH_HU)
    inside = mask_on(whole.body, grid)
    filled, gas = gas_filled(np.where(inside, hu, np.float32(LOW_HU)), step_mm)
    bone = mask_on(whole.bone, grid)
    return Scene(grid, hu, filled, gas & inside, inside, bone, pelvis, whole.bone, whole.hu, whole.fat, whole.muscle)


def _region(ct: Volume, pelvis: Pelvis, prompts: Prompts) -> tuple[FloatArray, FloatArray]:
    front, middle = pelvis.symphysis, pelvis.symphysis.mean(axis=0)
    low = np.array([middle[0] - BESIDE, front[0, 1] - BEFORE, front[0, 2] - BELOW])
    high = np.array([middle[0] + BESIDE, front[1, 1] + BEHIND, front[1, 2] + ABOVE])
    points = [*prompts.seeds.values()]
    for group in (*prompts.extremes.values(), *prompts.boxes.values()):
        points.extend(group)
    for point in points:
        low, high = np.minimum(low, point - ROOM_ABOUT_PROMPTS), np.maximum(high, point + ROOM_ABOUT_PROMPTS)
    scan = bounds(ct)
    return np.maximum(low, scan[0]), np.minimum(high, scan[1])
