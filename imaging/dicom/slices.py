"""The slices that DICOM image files hold: one of a plain file, many of an enhanced multi-frame one."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pydicom

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.dicom.files import DicomFile, reading

LARGEST_SIZE = 8192
# Words of ImageType and of series descriptions.
_SURVEYS = frozenset({"SURVEY", "SURVIEW"})
_SCOUTS = frozenset({"LOCALIZER", "SCOUT", "TOPOGRAM", "SCANOGRAM"}) | _SURVEYS
_DERIVED = frozenset({"DERIVED", "SECONDARY", "MPR", "REFORMATTED", "MIP", "MINIP", "PROJECTION IMAGE"})
# Cosine between a slice's normal and an axis of the patient above which it is named after it.
_UPRIGHT = 0.9


@dataclass(frozen=True, eq=False)
class Slice:
    """One plane of pixels and its place.

    frame : index in the file. instance : the series' own count, None where absent. right, down : unit vectors (3,) in
    LPS along which the column and row indices grow. origin : (3,) mm, centre of the first pixel. spacing : mm between
    columns and between rows. shape : (rows, columns). slope, intercept : stored value to HU.
    is_hu : whether the values are a CT's.
    padding : lowest and highest stored value that stands for no picture (outside a round field of view), None where not stated.
    """

    path: Path
    frame: int
    sop_uid: str
    instance: int | None
    right: FloatArray
    down: FloatArray
    origin: FloatArray
    spacing: tuple[float, float]
    shape: tuple[int, int]
    slope: float
    intercept: float
    is_hu: bool = True
    padding: tuple[int, int] | None = None

    @property
    def normal(self) -> FloatArray:
        """Unit vector (3,) across the slice."""
        return np.cross(self.right, self.down)


def is_image(header: pydicom.Dataset) -> bool:
    """Whether the object holds pixels that have a place in the patient."""
    placed = "ImagePositionPatient" in header or "PerFrameFunctionalGroupsSequence" in header
    return "Rows" in header and "Columns" in header and placed


def is_localizer(header: pydicom.Dataset) -> bool:
    """Whether the image is a scout view, which lies across the volume and is no part of it."""
    return not _SCOUTS.isdisjoint(_texts(header.get("ImageType")))


def kind_of(header: pydicom.Dataset) -> str:
    """What an image is beside a picture that a scanner took: localizer, survey, derived; "" where it is one."""
    kinds = _texts(header.get("ImageType"))
    described = set(re.findall(r"[A-Z]+", str(header.get("SeriesDescription") or "").upper()))
    if is_localizer(header) or described & _SCOUTS:
        return "survey" if described & _SURVEYS or _SURVEYS.intersection(kinds) else "localizer"
    return "derived" if not _DERIVED.isdisjoint(kinds) else ""


def plane_of(header: pydicom.Dataset) -> str:
    """axial, coronal, sagittal or oblique; "" where the header does not say."""
    groups = header.get("SharedFunctionalGroupsSequence")
    place = header if "ImageOrientationPatient" in header or not groups else _flat(groups[0])
    try:
        cosines = np.array([float(v) for v in place.get("ImageOrientationPatient") or []])
    except (TypeError, ValueError):
        return ""
    if cosines.shape != (6,) or not np.isfinite(cosines).all():
        return ""
    normal = np.abs(np.cross(cosines[:3], cosines[3:]))
    return ("sagittal", "coronal", "axial")[int(normal.argmax())] if normal.max() > _UPRIGHT else "oblique"


def slices_of(file: DicomFile) -> list[Slice]:
    """The slices of an image file. Raises InputError naming the file and the element that is missing or wrong."""
    header, path = file.header, file.path
    with reading(path):
        if _number(header, "SamplesPerPixel", path, default=1.0) != 1.0:
            raise InputError(f"{path} is a colour image, not a CT slice with HU; give the original CT series")
        # A segmentation's colours are those of its labels.
        grey = str(header.get("PhotometricInterpretation", "MONOCHROME2")) in ("MONOCHROME1", "MONOCHROME2")
        if not grey and header.get("Modality") != "SEG":
            raise InputError(f"{path} has palette colours, not HU; give the original CT series")
        if "PerFrameFunctionalGroupsSequence" in header:
            groups = list(header.PerFrameFunctionalGroupsSequence)
            shared = header.get("SharedFunctionalGroupsSequence") or [pydicom.Dataset()]
            return [_slice(file, index, _flat(shared[0], group)) for index, group in enumerate(groups)]
        if _number(header, "NumberOfFrames", path, default=1.0) != 1.0:
            raise InputError(f"{path} holds several frames without their positions; export the series as single slices")
        return [_slice(file, 0, header)]


def _flat(*groups: pydicom.Dataset) -> pydicom.Dataset:
    """The attributes of functional groups (shared first, per frame last) in one dataset."""
    flat = pydicom.Dataset()
    for group in groups:
        for element in group:
            if element.VR == "SQ" and not element.tag.is_private and len(element.value) == 1:
                flat.update(element.value[0])
    return flat


def _slice(file: DicomFile, frame: int, place: pydicom.Dataset) -> Slice:
    header, path = file.header, file.path
    if "COLOR" in (place.get("PixelPresentation"), header.get("PixelPresentation")):
        raise InputError(f"{path} holds colours (a map made from a scan), not HU; give the original CT series")
    right, down = _orientation(place, path)
    rows_apart, columns_apart = _numbers(place, "PixelSpacing", 2, path)
    if not (1e-3 < rows_apart < 100 and 1e-3 < columns_apart < 100):
        raise InputError(
            f"{path}: PixelSpacing is {rows_apart}, {columns_apart} mm; 0.001 to 100 is allowed; export it again"
        )
    slope, intercept = _rescale(place if "RescaleSlope" in place else header, header, path)
    instance = header.get("InstanceNumber") if place is header else None
    return Slice(
        path=path,
        frame=frame,
        sop_uid=str(header.get("SOPInstanceUID", "")),
        instance=int(instance) if instance is not None and str(instance).strip().lstrip("-").isdigit() else None,
        right=right,
        down=down,
        origin=np.array(_numbers(place, "ImagePositionPatient", 3, path)),
        spacing=(columns_apart, rows_apart),
        shape=(_size(header, "Rows", path), _size(header, "Columns", path)),
        slope=slope,
        intercept=intercept,
        is_hu=header.get("Modality") == "CT",
        padding=_padding(header),
    )


def _padding(header: pydicom.Dataset) -> tuple[int, int] | None:
    """PixelPaddingValue and the other end of its range (DICOM PS3.3 C.7.5.1.1.2), as they stand in the header."""
    ends = [header.get("PixelPaddingValue"), header.get("PixelPaddingRangeLimit")]
    known = [int(end) for end in ends if isinstance(end, int)]
    return (min(known), max(known)) if ends[0] is not None and known else None


def _orientation(place: pydicom.Dataset, path: Path) -> tuple[FloatArray, FloatArray]:
    cosines = np.array(_numbers(place, "ImageOrientationPatient", 6, path))
    right, down = cosines[:3], cosines[3:]
    lengths = np.linalg.norm(right), np.linalg.norm(down)
    if max(abs(lengths[0] - 1), abs(lengths[1] - 1), abs(right @ down)) > 1e-3:
        raise InputError(
            f"{path}: ImageOrientationPatient {cosines.tolist()} is no pair of unit vectors at right angles; export it again"
        )
    right = right / lengths[0]
    down = down - (down @ right) * right
    return right, down / np.linalg.norm(down)


def _rescale(place: pydicom.Dataset, header: pydicom.Dataset, path: Path) -> tuple[float, float]:
    if header.get("Modality") != "CT":
        return _number(place, "RescaleSlope", path, 1.0), _number(place, "RescaleIntercept", path, 0.0)
    kind = str(place.get("RescaleType") or "HU").strip().upper()
    if kind not in ("HU", "US", ""):
        raise InputError(f"{path} holds {kind} values, not HU; give the CT series that holds HU")
    slope = _number(place, "RescaleSlope", path)
    if slope == 0.0:
        raise InputError(f"{path}: RescaleSlope is 0, every pixel would be the same; export the series again")
    return slope, _number(place, "RescaleIntercept", path)


def _size(header: pydicom.Dataset, keyword: str, path: Path) -> int:
    size = _number(header, keyword, path)
    if not 1 <= size <= LARGEST_SIZE:
        raise InputError(f"{path}: {keyword} is {size:g}; 1 to {LARGEST_SIZE} is allowed; export the series again")
    return int(size)


def _number(source: pydicom.Dataset, keyword: str, path: Path, default: float | None = None) -> float:
    if default is not None and source.get(keyword) is None:
        return default
    return _numbers(source, keyword, 1, path)[0]


def _numbers(source: pydicom.Dataset, keyword: str, count: int, path: Path) -> list[float]:
    try:
        value: Any = source.get(keyword)
        numbers = [float(v) for v in (value if count > 1 else [value])]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != count or not np.isfinite(numbers).all():
        what = "lacks" if source.get(keyword) is None else "has an unreadable"
        raise InputError(f"{path} {what} {keyword}, without which it has no place or no HU; export the series again")
    return numbers


def _texts(value: Any) -> list[str]:
    return [
        str(v).upper() for v in (value if isinstance(value, list | tuple | pydicom.multival.MultiValue) else [value])
    ]
