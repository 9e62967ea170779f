"""NRRD and MetaImage files as SimpleITK reads them, and what it passes over: units, damage, voxels in other files, a place left out."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import SimpleITK as sitk

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.contours.checksums import check_deflated, check_gzip
from palpate.imaging.contours.nifti_labels import MOST_VOXELS

METAIMAGE = (".mha", ".mhd")
# Bytes; Slicer writes some hundred for each segment.
LONGEST_HEADER = 2**20
_SPACES = ("left-posterior-superior", "right-anterior-superior", "left-anterior-superior")
_UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3}
# Where a MetaImage lies, by the names that its writers use.
_NEEDED = {"ndims", "dimsize", "elementtype"}
_ORIENTATION, _POSITION = {"transformmatrix", "rotation", "orientation"}, {"offset", "position", "origin"}
# Its complaints of damaged files go to standard error, ten lines each.
sitk.ProcessObject.SetGlobalWarningDisplay(False)


# Of a MetaImage: keys in lower case, and the byte at which it ends.
_MetaHeader = tuple[Mapping[str, str], int]


@dataclass(frozen=True, eq=False)
class ItkImage:
    """image : voxels and metadata. affine : (4, 4), index to LPS, mm. notes : what was done, one line each.

    modality : what a MetaImage says that it shows; "" where it does not.
    """

    image: sitk.Image
    affine: FloatArray
    notes: tuple[str, ...]
    modality: str = ""


def read_itk_image(path: Path, remedy: str = "save it again") -> ItkImage:
    """A 3D image of one NRRD or MetaImage file, by its ending; MetaImage may have its voxels in a file beside it.

    remedy : what to do with a file that cannot be read. Raises InputError naming the file when it is not readable, damaged,
    no volume, sheared, in an unknown unit or without a place in the patient.
    """
    if not path.is_file():
        raise InputError(f"{path} is not there; correct its path")
    is_meta = path.name.lower().endswith(METAIMAGE)
    reader = sitk.ImageFileReader()
    reader.SetImageIO("MetaImageIO" if is_meta else "NrrdImageIO")
    reader.SetFileName(str(path))
    header = _meta_header(path, remedy) if is_meta else None
    scale = 1.0 if is_meta else _check_nrrd(path, remedy)
    try:
        reader.ReadImageInformation()
        if np.prod([float(n) for n in reader.GetSize()]) * reader.GetNumberOfComponents() > MOST_VOXELS:
            raise InputError(f"{path} has {reader.GetSize()} voxels, which is too many; crop it")
        if header is not None:
            _check_meta(path, header, reader, remedy)
        image = reader.Execute()
    except RuntimeError as error:
        raise InputError(f"{path} is not a readable {'MetaImage' if is_meta else 'NRRD'} file; {remedy}") from error
    if image.GetDimension() != 3:
        raise InputError(f"{path} has {image.GetDimension()} dimensions; one 3D volume is needed")
    if not is_meta and ("NRRD_space" not in image.GetMetaDataKeys() or image.GetMetaData("NRRD_space") not in _SPACES):
        raise InputError(f"{path} does not say where it lies in the patient (no space); {remedy}")
    notes = () if scale == 1.0 else (f"{path.name} states its place in units of {scale:g} mm and was scaled to mm",)
    return ItkImage(
        image, _placement(image, scale, path), notes, "" if header is None else header[0].get("modality", "")
    )


def voxel_files(path: Path) -> list[Path]:
    """The file, and the one beside it that holds its voxels, where a MetaImage (.mhd) names one. Raises InputError."""
    if not path.name.lower().endswith(METAIMAGE) or not path.is_file():
        return [path]
    name = _meta_header(path, "save it again")[0]["elementdatafile"]
    return [path] if name.upper() == "LOCAL" else [path, _beside(path, name)]


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


def _check_meta(path: Path, header: _MetaHeader, reader: sitk.ImageFileReader, remedy: str) -> None:
    """Raises InputError where voxels are missing or damaged, or the file does not say where it lies."""
    fields, end = header
    if not fields.keys() & _ORIENTATION or not fields.keys() & _POSITION:
        raise InputError(f"{path} does not say where it lies in the patient (TransformMatrix, Offset); {remedy}")
    inside = fields["elementdatafile"].upper() == "LOCAL"
    file = path if inside else _beside(path, fields["elementdatafile"])
    with file.open("rb") as stream:
        stream.seek(end if inside else 0)
        if fields.get("compresseddata", "").lower() == "true":
            check_deflated(stream, file)
            return
    pixel = sitk.Image([1, 1, 1], reader.GetPixelID(), reader.GetNumberOfComponents())
    needed = int(np.prod(reader.GetSize())) * pixel.GetSizeOfPixelComponent() * reader.GetNumberOfComponents()
    if file.stat().st_size - (end if inside else 0) < needed:
        raise InputError(f"{file} ends before its voxels do; copy it again")


def _meta_header(path: Path, remedy: str) -> _MetaHeader:
    """The header of a MetaImage. Raises InputError where it lacks what SimpleITK would complain of on standard error."""
    fields: dict[str, str] = {}
    with path.open("rb") as stream:
        while stream.tell() < LONGEST_HEADER:
            key, sign, value = stream.readline(LONGEST_HEADER).decode("latin-1").partition("=")
            if not sign:
                break
            fields[key.strip().lower()] = value.strip()
            if key.strip().lower() == "elementdatafile" and fields.keys() >= _NEEDED:
                return fields, stream.tell()
    raise InputError(f"{path} is not a readable MetaImage file; {remedy}")


def _beside(path: Path, name: str) -> Path:
    file = path.with_name(Path(name).name or path.name)
    if Path(name).name != name or "\\" in name or not file.is_file() or file == path:
        raise InputError(f"{path} names no file beside it that holds its voxels; save it as one .mha file")
    return file


def _placement(image: sitk.Image, scale: float, path: Path) -> FloatArray:
    affine = np.eye(4)
    spacing, direction = np.array(image.GetSpacing()), np.array(image.GetDirection()).reshape(3, 3)
    affine[:3, :3], affine[:3, 3] = scale * direction * spacing, scale * np.array(image.GetOrigin())
    off = np.abs(direction.T @ direction - np.eye(3)).max()
    if not np.isfinite(affine).all() or scale * spacing.min() < 1e-3 or off > 1e-3:
        raise InputError(f"{path} has a sheared or degenerate grid; resample it onto a right-angled one")
    return affine
