"""NRRD files as SimpleITK reads them, and what it passes over: units, damage, voxels in other files, a place left out."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import SimpleITK as sitk

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.files.places import check_utf8
from palpate.imaging.contours.checksums import check_gzip
from palpate.imaging.contours.nifti_labels import MOST_VOXELS

# Bytes; Slicer writes some hundred for each segment.
LONGEST_HEADER = 2**20
_SPACES = ("left-posterior-superior", "right-anterior-superior", "left-anterior-superior")
_UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3}
# Its complaints of damaged files go to standard error, ten lines each.
sitk.ProcessObject.SetGlobalWarningDisplay(False)


@dataclass(frozen=True, eq=False)
class ItkImage:
    """image : voxels and metadata. affine : (4, 4), index to LPS, mm. notes : what was done, one line each."""

    image: sitk.Image
    affine: FloatArray
    notes: tuple[str, ...]


def read_nrrd(path: Path, remedy: str = "save it again") -> ItkImage:
    """A 3D image of one NRRD file.

    remedy : what to do with a file that cannot be read. Raises InputError naming the file when it is not readable, damaged,
    no volume, sheared, in an unknown unit or without a place in the patient.
    """
    if not path.is_file():
        raise InputError(f"{path} is not there; correct its path")
    check_utf8(path, "rename it or its folder")
    reader = sitk.ImageFileReader()
    reader.SetImageIO("NrrdImageIO")
    reader.SetFileName(str(path))
    scale = _check_nrrd(path, remedy)
    try:
        reader.ReadImageInformation()
        if np.prod([float(n) for n in reader.GetSize()]) * reader.GetNumberOfComponents() > MOST_VOXELS:
            raise InputError(f"{path} has {reader.GetSize()} voxels, which is too many; crop it")
        image = reader.Execute()
    except RuntimeError as error:
        raise InputError(f"{path} is not a readable NRRD file; {remedy}") from error
    if image.GetDimension() != 3:
        raise InputError(f"{path} has {image.GetDimension()} dimensions; one 3D volume is needed")
    if "NRRD_space" not in image.GetMetaDataKeys() or image.GetMetaData("NRRD_space") not in _SPACES:
        raise InputError(f"{path} does not say where it lies in the patient (no space); {remedy}")
    notes = () if scale == 1.0 else (f"{path.name} states its place in units of {scale:g} mm and was scaled to mm",)
    return ItkImage(image, _placement(image, scale, path), notes)


def _check_nrrd(path: Path, remedy: str) -> float:
    """The file's unit, mm. Raises InputError where the voxels lie in another file or are damaged, or the unit is unknown."""
    with path.open("rb") as stream:
        text = stream.read(LONGEST_HEADER).replace(b"\r\n", b"\n").partition(b"\n\n")[0].decode("latin-1")
        fields = dict(re.findall(r"^([^#:\n]+): *(.*)$", text, re.MULTILINE))
        fields = {name.lower(): value for name, value in fields.items()}
        if fields.keys() & {"data file", "datafile"}:
            raise InputError(f"{path} has its voxels in another file; save it as one file: {remedy}")
        if fields.get("encoding", "").strip().lower() in ("gzip", "gz"):
            stream.seek(0)
            for line in stream:
                if not line.strip():
                    break
            check_gzip(stream, path)
    units = set(re.findall(r'"([^"]*)"', fields.get("space units", '"mm"'))) - {""} or {"mm"}
    unit = units.pop()
    if units or unit not in _UNITS_MM:
        shown = "".join(c for c in ", ".join(sorted({unit, *units})) if c.isprintable())[:40]
        raise InputError(f"{path}: its space units are {shown}; {', '.join(_UNITS_MM)} are known: {remedy} in mm")
    return _UNITS_MM[unit]


def _placement(image: sitk.Image, scale: float, path: Path) -> FloatArray:
    affine = np.eye(4)
    spacing, direction = np.array(image.GetSpacing()), np.array(image.GetDirection()).reshape(3, 3)
    affine[:3, :3], affine[:3, 3] = scale * direction * spacing, scale * np.array(image.GetOrigin())
    off = np.abs(direction.T @ direction - np.eye(3)).max()
    if not np.isfinite(affine).all() or scale * spacing.min() < 1e-3 or off > 1e-3:
        raise InputError(f"{path} has a sheared or degenerate grid; resample it onto a right-angled one")
    return affine
