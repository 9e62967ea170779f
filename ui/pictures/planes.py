"""Slices of a volume along the patient's own axes, whatever the grid's axes are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import SimpleITK as sitk

from palpate.core.arrays import BoolArray, FloatArray
from palpate.imaging.volume import Volume


@dataclass(frozen=True)
class Plane:
    """An anatomical plane as radiologists look at it.

    normal, across, down : patient axes (0 left, 1 posterior, 2 superior) through the slice, along the screen's rows and
    along its columns. down_sign : +1 when the screen's downward direction is the axis' own, -1 when it is opposed.
    left, right, top, bottom : letters at the picture's edges.
    """

    name: str
    normal: int
    across: int
    down: int
    down_sign: int
    left: str
    right: str
    top: str
    bottom: str


# The viewer stands at the patient's feet and before him: the patient's right is on the screen's left.
AXIAL = Plane("axial", 2, 0, 1, +1, "R", "L", "A", "P")
SAGITTAL = Plane("sagittal", 0, 1, 2, -1, "A", "P", "S", "I")
CORONAL = Plane("coronal", 1, 0, 2, -1, "R", "L", "S", "I")
PLANES = (AXIAL, SAGITTAL, CORONAL)


@dataclass(frozen=True)
class Window:
    """A square field of view: centre (3,) mm LPS and half its edge, mm; step_mm is the size of a pixel."""

    centre: tuple[float, float, float]
    half_mm: float
    step_mm: float = 0.5

    @property
    def pixels(self) -> int:
        """Pixels along each edge."""
        return max(2, round(2.0 * self.half_mm / self.step_mm))


@dataclass(frozen=True, eq=False)
class Slice:
    """values (rows, columns), first row at the top of the screen; extent in mm as matplotlib's imshow takes it:
    patient coordinates at the left, right, bottom and top edge."""

    values: FloatArray
    extent: tuple[float, float, float, float]

    @property
    def coordinates(self) -> tuple[FloatArray, FloatArray]:
        """Patient coordinates of the columns' and of the rows' pixel centres, mm."""
        left, right, bottom, top = self.extent
        rows, columns = self.values.shape
        across = left + (np.arange(columns) + 0.5) * (right - left) / columns
        down = top + (np.arange(rows) + 0.5) * (bottom - top) / rows
        return across, down


def reslice(volume: Volume, plane: Plane, window: Window, fill: float) -> Slice:
    """The slice through the window's centre, linearly interpolated; ``fill`` where the volume does not reach."""
    n, step = window.pixels, window.step_mm
    axes = np.zeros((3, 3))
    axes[plane.across, 0] = 1.0
    axes[plane.down, 1] = plane.down_sign
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    corner = np.array(window.centre) - 0.5 * (n - 1) * step * (axes[:, 0] + axes[:, 1])
    image = sitk.Resample(
        sitk.Cast(volume.to_sitk(), sitk.sitkFloat32), (n, n, 1), sitk.Transform(3, sitk.sitkIdentity), sitk.sitkLinear,
        corner.tolist(), (step, step, step), axes.ravel().tolist(), float(fill),
    )  # fmt: skip
    first, last = corner - 0.5 * step * (axes[:, 0] + axes[:, 1]), corner + (n - 0.5) * step * (axes[:, 0] + axes[:, 1])
    extent = (first[plane.across], last[plane.across], last[plane.down], first[plane.down])
    left, right, bottom, top = (float(x) for x in extent)
    return Slice(sitk.GetArrayFromImage(image)[0].astype(np.float64), (left, right, bottom, top))


def share_of_label(labels: Volume, label: int, plane: Plane, window: Window) -> Slice:
    """How much of each pixel is a label, 0 to 1: its half level is a smoother outline than the voxels' stairs."""
    return reslice(labels.with_array((labels.array == label).astype(np.float32)), plane, window, 0.0)


def reached(volume: Volume, plane: Plane, window: Window) -> BoolArray:
    """Whether the volume reaches each pixel (rows, columns) of the slice."""
    here = reslice(volume.with_array(np.ones(volume.array.shape, dtype=np.float32)), plane, window, 0.0)
    return here.values > 0.5


def centre_of(labels: Volume, label_ids: tuple[int, ...]) -> FloatArray:
    """The centre (3,) mm of the voxels of some labels; of the whole grid where there are none."""
    index = np.argwhere(np.isin(labels.array, label_ids))
    if not len(index):
        return labels.to_lps((np.array([labels.array.shape]) - 1) / 2.0)[0]
    return labels.to_lps(index.astype(float)).mean(axis=0)


def reach_of(labels: Volume, label_ids: tuple[int, ...]) -> FloatArray:
    """The box (2, 3) mm, lowest and highest coordinate, of the voxel centres of some labels; of the grid where there are none."""
    index = np.argwhere(np.isin(labels.array, label_ids))
    if not len(index):
        index = np.argwhere(np.ones(labels.array.shape, dtype=bool))
    points = labels.to_lps(index.astype(float))
    return np.stack([points.min(axis=0), points.max(axis=0)])
