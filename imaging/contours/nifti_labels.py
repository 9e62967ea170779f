"""Label volumes as NIfTI files, the way ITK-SNAP writes them."""

from __future__ import annotations

import html
import logging
import math
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import nibabel as nib
import numpy as np
from nibabel import imageglobals
from nibabel.filebasedimages import ImageFileError
from nibabel.spatialimages import HeaderDataError

from palpate.core.arrays import FloatArray, NumberArray
from palpate.core.errors import InputError
from palpate.imaging.contours.checksums import check_gzip_file
from palpate.imaging.labels import LABELS
from palpate.imaging.volume import Volume

# Endings of NIfTI files.
NIFTI = (".nii", ".nii.gz")
# NIfTI's world is RAS, patient coordinates here are LPS (DICOM): x and y change sign.
RAS_TO_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])
_SCANNER_COORDINATES = 1
_MILLIMETRES = 2
_OTHER_UNITS = {1: "meter", 3: "micron"}
MOST_VOXELS = 10**9
# Values this near a whole number are it.
WHOLE_WITHIN = 1e-3

_NAMED = re.compile(r'<Label\b[^<>]*\bKey="(\d{1,6})"[^<>]*>\s*(?:<!\[CDATA\[)?([^<>\]]*)', re.IGNORECASE)
# nibabel tells of odd headers on standard error; what matters is checked here.
imageglobals.logger.setLevel(logging.CRITICAL)


def read_labels(path: Path, values: Mapping[int, int] | None = None) -> Volume:
    """The label volume (uint8, values of LABELS) of a NIfTI file, on the file's own grid.

    values : what each number of the file means, file value -> value of LABELS, where a label description file says
        that it differs from LABELS (``itksnap_labels.label_values``).

    Raises InputError naming the file when it is no NIfTI, not 3D, empty, without a placement in the patient, sheared,
    or holds a value that is no label.
    """
    return with_meaning(read_numbers(path), values or {value: value for value in LABELS}, path)


def read_numbers(path: Path) -> Volume:
    """The whole numbers that a NIfTI file holds, on its own grid. Raises InputError as ``read_labels`` does."""
    image = _open(path)
    array, affine = _pixels(image, path), _placement(image, path)
    return Volume(whole_numbers(array, path), affine)


def whole_numbers(array: NumberArray, path: Path) -> NumberArray:
    """The numbers of a label volume, each rounded. Raises InputError naming the file where they are no whole numbers, one a voxel."""
    if array.ndim != 3 or array.dtype.kind not in "iuf":
        raise InputError(f"{path} holds more than a number for each voxel; save it as a label volume, or a .seg.nrrd")
    whole = np.rint(array)
    # A scl_slope in single precision makes 1 to 1.00000004.
    if not np.abs(array - whole).max() <= WHOLE_WITHIN:
        raise InputError(
            f"{path} holds values that are not whole numbers; a label volume is needed, not a CT or a probability"
        )
    return whole


def names_within(path: Path) -> dict[int, str]:
    """The names of its values that a NIfTI file holds in its header extensions, value -> name; empty where it has none.

    TotalSegmentator writes them there as Connectome Workbench does: <Label Key="4">name</Label>.
    """
    header = _open(path).header
    found: dict[int, str] = {}
    for extension in getattr(header, "extensions", ()):
        content = extension.get_content()
        text = content.decode("utf-8", "replace") if isinstance(content, bytes) else str(content)
        for value, name in _NAMED.findall(text):
            found.setdefault(int(value), " ".join(html.unescape(name).split()))
    return found


def with_meaning(numbers: Volume, values: Mapping[int, int], path: Path) -> Volume:
    """Labels (uint8, values of LABELS) of a file's numbers. values : file value -> value of LABELS.

    Raises InputError naming the file when it holds another number, or nothing but 0.
    """
    present = np.unique(numbers.array)
    meaning = {**values, 0: values.get(0, 0)}
    unknown = [int(value) for value in present if int(value) not in meaning]
    if unknown:
        known = ", ".join(f"{value} {LABELS[meaning[value]]}" for value in sorted(meaning))
        raise InputError(
            f"{path} holds the value {unknown[0]}, which is no label ({known}); relabel it or name it in labels.txt"
        )
    table = np.array([meaning[int(value)] for value in present], dtype=np.uint8)
    labels = table[np.searchsorted(present, numbers.array)]
    if not labels.any():
        raise InputError(f"{path} holds no label, only 0 (outside); save the segmentation again")
    return numbers.with_array(labels)


def write_labels(path: Path, labels: Volume) -> None:
    """Writes a label volume as ITK-SNAP would: uint8, RAS affine in both sform and qform, mm."""
    write_nifti(path, labels.with_array(labels.array.astype(np.uint8)))


def write_nifti(path: Path, volume: Volume) -> None:
    """Writes any volume (labels, CT in HU, a map) as NIfTI at ``path``; the suffix decides on compression."""
    affine = RAS_TO_LPS @ volume.affine
    image = nib.Nifti1Image(volume.array, affine)
    image.header.set_xyzt_units("mm")
    image.set_sform(affine, code=_SCANNER_COORDINATES)
    image.set_qform(affine, code=_SCANNER_COORDINATES)
    nib.save(image, path)


def read_nifti(path: Path) -> Volume:
    """Any 3D NIfTI (a CT in HU, a map) on its own grid, in LPS. Raises InputError as ``read_labels`` does."""
    image = _open(path)
    return Volume(_pixels(image, path), _placement(image, path))


def _open(path: Path) -> Any:
    if not path.is_file():
        raise InputError(f"{path} is not there; give the path of a NIfTI file (.nii or .nii.gz)")
    try:
        image = nib.load(path)
    except (ImageFileError, HeaderDataError, OSError, EOFError, OverflowError, ValueError, zlib.error) as error:
        raise InputError(f"{path} is not a readable NIfTI file; save it again as .nii.gz") from error
    if not isinstance(image, nib.Nifti1Image):
        raise InputError(f"{path} is {type(image).__name__}, not NIfTI; save it as .nii.gz")
    _check_whole(path)
    return image


def _check_whole(path: Path) -> None:
    try:
        check_gzip_file(path)
    except OSError as error:
        raise InputError(f"{path} is not a readable NIfTI file; save it again as .nii.gz") from error


def _pixels(image: Any, path: Path) -> NumberArray:
    shape = image.shape
    while len(shape) > 3 and shape[-1] == 1:
        shape = shape[:-1]
    if len(shape) != 3 or min(shape) < 1 or math.prod(shape) > MOST_VOXELS:
        raise InputError(
            f"{path} has shape {image.shape}; one 3D volume is needed; save one time point or component only"
        )
    try:
        array = np.asarray(image.dataobj).reshape(shape)
    except (OSError, EOFError, OverflowError, ValueError, zlib.error) as error:
        raise InputError(f"{path} ends before its voxels do; copy or save it again") from error
    if array.dtype.kind not in "iuf":
        raise InputError(
            f"{path} holds voxels of type {array.dtype}; single numbers are needed; save it as a label volume"
        )
    if not np.isfinite(array).all():
        raise InputError(f"{path} holds voxels that are not finite; save it again")
    return array


def _placement(image: Any, path: Path) -> FloatArray:
    header = image.header
    try:
        sform, qform = header.get_sform(coded=True)[0], header.get_qform(coded=True)[0]
    except (HeaderDataError, ValueError) as error:
        raise InputError(f"{path} has a damaged placement in the patient; save it again with ITK-SNAP") from error
    if sform is None and qform is None:
        raise InputError(
            f"{path} does not say where it lies in the patient (sform and qform codes 0); save it with ITK-SNAP"
        )
    unit = int(header["xyzt_units"]) & 7
    if unit not in (0, _MILLIMETRES):
        name = _OTHER_UNITS.get(unit, f"unit code {unit}")
        raise InputError(f"{path} is not in mm ({name}); save it with ITK-SNAP, which writes mm")
    affine = np.array(qform if sform is None else sform, dtype=np.float64)
    columns = affine[:3, :3]
    lengths = np.linalg.norm(columns, axis=0)
    if not np.isfinite(affine).all() or lengths.min() < 1e-3:
        raise InputError(f"{path} has voxel edges of {lengths.tolist()} mm; each must be above 0.001; save it again")
    if np.abs((columns / lengths).T @ (columns / lengths) - np.eye(3)).max() > 1e-3:
        raise InputError(f"{path} has a sheared grid; resample it onto a right-angled one")
    if sform is not None and qform is not None:
        _check_agreement(sform, qform, np.array([*image.shape[:3], 1.0]), float(lengths.min()), path)
    return RAS_TO_LPS @ affine


def _check_agreement(sform: NumberArray, qform: NumberArray, corner: NumberArray, voxel: float, path: Path) -> None:
    origin = np.array([0.0, 0.0, 0.0, 1.0])
    apart = max(float(np.linalg.norm((sform - qform) @ point)) for point in (origin, corner))
    if apart > 0.5 * voxel:
        raise InputError(
            f"{path} has two placements (sform, qform) that lie {apart:.1f} mm apart; save it with ITK-SNAP"
        )
