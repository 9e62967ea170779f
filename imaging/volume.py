"""An image in patient coordinates: an array and the affine that places it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import SimpleITK as sitk
from numpy.typing import ArrayLike
from scipy import ndimage

from palpate.core.arrays import FloatArray, NumberArray


@dataclass(frozen=True, eq=False)
class Volume:
    """A regular 3D image.

    array : (ni, nj, nk); CT in HU (int16 or float32), labels in uint8. A field of vectors has a fourth axis.
    affine : (4, 4), maps index (i, j, k, 1) to DICOM patient coordinates LPS in mm, voxel centres.
    """

    array: NumberArray
    affine: FloatArray

    @classmethod
    def upright(cls, low: FloatArray, spacing: FloatArray, shape: ArrayLike) -> Volume:
        """An empty label volume whose axes are those of LPS. low : (3,) mm, centre of the first voxel. shape : (3,) voxels."""
        affine = np.diag([*spacing, 1.0])
        affine[:3, 3] = low
        return cls(np.zeros(np.asarray(shape, dtype=int), dtype=np.uint8), affine)

    @property
    def spacing(self) -> FloatArray:
        """Voxel edge lengths (3,) mm."""
        return np.linalg.norm(self.affine[:3, :3], axis=0)

    def to_lps(self, index: FloatArray) -> FloatArray:
        """Patient coordinates (n, 3) mm of (fractional) indices (n, 3)."""
        return np.asarray(index, dtype=float) @ self.affine[:3, :3].T + self.affine[:3, 3]

    def to_index(self, lps: FloatArray) -> FloatArray:
        """Fractional indices (n, 3) of patient coordinates (n, 3) mm."""
        return (np.asarray(lps, dtype=float) - self.affine[:3, 3]) @ np.linalg.inv(self.affine[:3, :3]).T

    def at(self, lps: FloatArray) -> FloatArray:
        """Values (n,) at patient coordinates (n, 3) mm by trilinear interpolation; the nearest edge value beyond the grid.

        Values (n, c) where the array is a field (ni, nj, nk, c).
        """
        if np.issubdtype(self.array.dtype, np.floating):
            from palpate.imaging.sampling import linear  # here: its compiler takes long to load

            values = linear(self.array[..., None] if self.array.ndim == 3 else self.array, self.to_index(lps))
            return values[:, 0] if self.array.ndim == 3 else values
        if self.array.ndim == 4:
            return np.stack([self.with_array(self.array[..., c]).at(lps) for c in range(self.array.shape[3])], axis=-1)
        # Left to itself SciPy would round the values of a volume of integers.
        return np.asarray(
            ndimage.map_coordinates(self.array, self.to_index(lps).T, np.float64, order=1, mode="nearest")
        )

    def nearest(self, lps: FloatArray, outside: float = 0) -> NumberArray:
        """Values (n,) of the voxels that hold patient coordinates (n, 3) mm; `outside` beyond the grid.

        In the array's own type, as floats where `outside` is one.
        """
        index = np.rint(self.to_index(lps)).astype(int)
        inside = ((index >= 0) & (index < self.array.shape[:3])).all(axis=1)
        out = np.full(len(index), outside, dtype=np.float64 if isinstance(outside, float) else self.array.dtype)
        out[inside] = self.array[tuple(index[inside].T)]
        return out

    def with_array(self, array: NumberArray) -> Volume:
        """The same grid with other values."""
        return Volume(array, self.affine)

    def moved(self, transform: FloatArray) -> Volume:
        """The same values on a grid moved by a rigid transform (4, 4) in LPS: no resampling."""
        return Volume(self.array, transform @ self.affine)

    def to_sitk(self) -> sitk.Image:
        """The SimpleITK image with the same place in patient coordinates."""
        image = sitk.GetImageFromArray(np.ascontiguousarray(np.transpose(self.array)))
        image.SetSpacing([float(s) for s in self.spacing])
        image.SetOrigin([float(x) for x in self.affine[:3, 3]])
        image.SetDirection((self.affine[:3, :3] / self.spacing).ravel().tolist())
        return image

    @classmethod
    def from_sitk(cls, image: sitk.Image) -> Volume:
        """The volume of a SimpleITK image (whose coordinates are LPS)."""
        affine = np.eye(4)
        affine[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
        affine[:3, 3] = image.GetOrigin()
        return cls(np.transpose(sitk.GetArrayFromImage(image)), affine)
