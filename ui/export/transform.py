"""For ITK programs: the alignment of the two scans as a transform, the displacement that was found as a field."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
import SimpleITK as sitk

from palpate.case.case_folder import CaseFolder
from palpate.case.meshed import load_meshed
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.imaging.volume import Volume

WRITES = (
    "ITK transforms from the scan at rest to the deformed one, by bone and by tissue, and displacement field, mm, LPS"
)
_TRANSFORM, _FIELD, _TISSUE = "rest_to_deformed.tfm", "displacement_mm.nrrd", "tissue_rest_to_deformed.h5"


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes what the case has; LPS, mm, as ITK resamples: points at rest go to points of the other scan.

    rest_to_deformed.tfm : rigid, from the bones: resamples the deformed scan onto the scan at rest. displacement_mm.nrrd : of each
    voxel of the labels at rest within the mesh, in the frame of the scan at rest, 0 elsewhere; adds to the place at rest.
    tissue_rest_to_deformed.h5 : both as one ITK transform, displacement first: resamples the deformed scan so that the organ
    lies where it lay at rest, as far as the model goes.
    Raises InputError when the case has neither, or it cannot write.
    """
    written = []
    if case.has("alignment.json"):
        written.append(folder / _TRANSFORM)
        with atomic_path(written[-1]) as path:
            # SimpleITK knows the form by the ending, which a temporary name lacks.
            named = path.with_suffix(".tfm")
            sitk.WriteTransform(_rigid(np.linalg.inv(case.deformed_to_rest()).astype(np.float64)), str(named))
            named.replace(path)
    if case.has("identify/fields.npz") and case.has("mesh.npz"):
        written.append(folder / _FIELD)
        with atomic_path(written[-1]) as path:
            field = _field(case)
            sitk.WriteImage(field, str(path), useCompression=True, imageIO="NrrdImageIO")
        written.append(folder / _TISSUE)
        with atomic_path(written[-1]) as path:
            named = path.with_suffix(".h5")
            sitk.WriteTransform(_both(field, case.deformed_to_rest()), str(named))
            named.replace(path)
    if not written:
        raise InputError(f"{case.path} has neither alignment.json nor a displacement; import two scans first")
    return written


def _both(field: sitk.Image, deformed_to_rest: FloatArray) -> sitk.CompositeTransform:
    """The displacement, then the way into the deformed scan's own frame. ITK applies what was added last first."""
    out = sitk.CompositeTransform(3)
    out.AddTransform(_rigid(np.linalg.inv(deformed_to_rest).astype(np.float64)))
    out.AddTransform(sitk.DisplacementFieldTransform(sitk.Cast(field, sitk.sitkVectorFloat64)))
    return out


def _rigid(matrix: FloatArray) -> sitk.AffineTransform:
    out = sitk.AffineTransform(3)
    out.SetMatrix(matrix[:3, :3].ravel().tolist())
    out.SetTranslation(matrix[:3, 3].tolist())
    return out


def _field(case: CaseFolder) -> sitk.Image:
    mesh, labels = load_meshed(case).mesh, case.labels("rest")
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: mesh.cells}, mesh.points)
    grid.point_data["u"] = case.read_npz("identify/fields.npz")["mesh_displacement"]
    inside = labels.array != 0
    points = pv.PolyData(labels.to_lps(np.argwhere(inside).astype(np.float64)))
    sampled = points.sample(grid)
    u = np.asarray(sampled["u"], dtype=np.float64) * np.asarray(sampled["vtkValidPointMask"])[:, None]
    array = np.zeros((*labels.array.shape, 3))
    array[inside] = u
    return _vectors(labels, array)


def _vectors(labels: Volume, array: FloatArray) -> sitk.Image:
    """A field (i, j, k, 3) mm on the grid of the labels."""
    like = labels.with_array(np.zeros(labels.array.shape, dtype=np.float32)).to_sitk()
    out = sitk.GetImageFromArray(np.ascontiguousarray(array.transpose(2, 1, 0, 3)), isVector=True)
    out.CopyInformation(like)
    return out
