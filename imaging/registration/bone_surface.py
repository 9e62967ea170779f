"""Bone as CT and labels show it: a field to register by, and surface points to measure by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import SimpleITK as sitk
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.labels import BONE
from palpate.imaging.volume import Volume

# Below is soft tissue, which moves between the scans; above differs with scanner and metal.
SOFT_HU, DENSE_HU = 100.0, 500.0
# Cortical and most spongy bone, above contrast medium in soft tissue.
BONE_HU = 200.0
# Smaller pieces are calcifications, seeds, contrast, noise.
SMALLEST_PIECE_CC = 2.0
WORKING_MM = 2.0


@dataclass(frozen=True, eq=False)
class BoneField:
    """field : float32 image, 0 in soft tissue to 1 in dense bone. mask : uint8 image of bone on the same grid.

    level : the value of ``field`` on the bone's surface.
    """

    field: sitk.Image
    mask: sitk.Image
    level: float


def bone_of_ct(ct: Volume, source: str) -> BoneField:
    """Bone of a CT in HU, on its grid or one about 2 mm wide. Raises InputError naming ``source`` when there is none."""
    image = sitk.Cast(_shrunk(ct.to_sitk()), sitk.sitkFloat32)
    field = sitk.IntensityWindowing(image, SOFT_HU, DENSE_HU, 0.0, 1.0)
    mask = _large_pieces(image > BONE_HU)
    if not sitk.GetArrayViewFromImage(mask).any():
        raise InputError(f"{source} shows no bone above {BONE_HU:.0f} HU; give CT scans that hold the pelvic bones")
    return BoneField(field, mask, (BONE_HU - SOFT_HU) / (DENSE_HU - SOFT_HU))


def bone_of_labels(labels: Volume, source: str) -> BoneField:
    """Bone of a label volume. Raises InputError naming ``source`` when it has no bone label."""
    image = sitk.Cast(labels.to_sitk() == BONE, sitk.sitkFloat32)
    mask = _large_pieces(_shrunk(image) > 0.5)
    if not sitk.GetArrayViewFromImage(mask).any():
        raise InputError(f"{source} has no bone (label {BONE}); label the bone in both states")
    smooth = sitk.SmoothingRecursiveGaussian(image, [1.0] * 3)
    return BoneField(_shrunk(smooth), mask, 0.5)


@dataclass(frozen=True, eq=False)
class OrientedPoints:
    """Points (n, 3) mm on a surface and its unit normals there (n, 3)."""

    points: FloatArray
    normals: FloatArray

    def distances(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """From points (m, 3) mm: along the normal of the nearest surface point (m,), and to that point itself (m,)."""
        far, nearest = cKDTree(self.points).query(points)
        along = np.einsum("ij,ij->i", points - self.points[nearest], self.normals[nearest])
        return along, far


def bone_surface(bone: BoneField) -> OrientedPoints:
    """The bone's surface, interpolated between voxels; small pieces are left out."""
    near = sitk.GetArrayFromImage(sitk.BinaryDilate(bone.mask, [2, 2, 2]))
    values = np.where(near, sitk.GetArrayViewFromImage(bone.field), 0.0)
    volume = Volume.from_sitk(bone.field)
    vertices, _, normals, _ = marching_cubes(np.transpose(values), level=bone.level)
    in_patient = normals @ np.linalg.inv(volume.affine[:3, :3])
    in_patient /= np.maximum(np.linalg.norm(in_patient, axis=1, keepdims=True), 1e-12)
    return OrientedPoints(volume.to_lps(vertices), in_patient)


def _shrunk(image: sitk.Image) -> sitk.Image:
    return sitk.BinShrink(image, [max(1, int(WORKING_MM / spacing + 1e-6)) for spacing in image.GetSpacing()])


def _large_pieces(mask: sitk.Image) -> sitk.Image:
    smallest = int(SMALLEST_PIECE_CC * 1000.0 / np.prod(mask.GetSpacing())) + 1
    pieces = sitk.RelabelComponent(sitk.ConnectedComponent(mask), smallest, True)
    return sitk.Cast(pieces > 0, sitk.sitkUInt8)
