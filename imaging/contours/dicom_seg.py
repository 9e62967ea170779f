"""DICOM segmentations: segments by name on the grid of their frames."""

from __future__ import annotations

import logging
import sqlite3
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pydicom
from highdicom import VolumeGeometry
from highdicom.seg import Segmentation

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.imaging.contours.dicom_seg_filled import fill_in, pixel_measures
from palpate.imaging.contours.nifti_labels import MOST_VOXELS
from palpate.imaging.contours.roi_names import distinct
from palpate.imaging.contours.structure_names import organ_of
from palpate.imaging.dicom.files import DAMAGE, DicomFile, quiet, read_file, reading
from palpate.imaging.dicom.slices import Slice, slices_of
from palpate.imaging.dicom.stack import EVEN_WITHIN_MM
from palpate.imaging.volume import Volume

# highdicom tells of odd files on its log; what matters is checked here.
logging.getLogger("highdicom").setLevel(logging.CRITICAL)
# Frames at positions nearer than this are of one slice; frames further from the lattice than this share of it are uneven.
SAME_PLANE_MM = 0.01
OFF_LATTICE = 0.05
# A narrower gap stated between slices is none, mm.
SMALLEST_GAP_MM = 0.05
_REFERENCES = (
    *("PatientID", "PatientName", "FrameOfReferenceUID", "ReferencedFrameOfReferenceSequence"),
    "ReferencedSeriesSequence",
)
_KINDS = ("BINARY", "FRACTIONAL", "LABELMAP")
# What decoding damaged pixels raises beside what reading elements does.
_PIXEL_DAMAGE = (*DAMAGE, IndexError, OverflowError, ZeroDivisionError, MemoryError, sqlite3.Error)


@dataclass(frozen=True, eq=False)
class DicomSegments:
    """A DICOM SEG. origin : the patient and images that it says it was drawn on. numbers : name -> number of the segment.

    full : the stored value that is certain, of a fractional one. tolerance : mm by which frames may lie beside their slice.
    """

    path: Path
    dataset: Segmentation
    origin: pydicom.Dataset
    numbers: dict[str, int]
    geometry: VolumeGeometry
    full: float
    tolerance: float
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> list[str]:
        """Of the segments."""
        return list(self.numbers)

    @cached_property
    def grid(self) -> Volume:
        """An empty volume on which all frames lie; i, j, k run along rows, columns and slices."""
        affine = self.geometry.affine[:, [2, 1, 0, 3]]
        return Volume(np.zeros(self.geometry.spatial_shape[::-1], dtype=np.uint8), np.asarray(affine, dtype=np.float64))

    def mask(self, name: str) -> BoolArray:
        """The voxels of a segment; those at least half certain of a fractional one."""
        try:
            with quiet():
                found = self.dataset.get_volume(
                    segment_numbers=[self.numbers[name]], rescale_fractional=False, atol=self.tolerance
                )
        except _PIXEL_DAMAGE as error:
            raise InputError(f"{self.path} has pixels that cannot be decoded; export the segmentation again") from error
        return np.transpose(found.array[..., 0] >= max(0.5 * self.full, 0.5), (2, 1, 0))


def read_dicom_seg(path: Path) -> DicomSegments:
    """The segments of a DICOM SEG. Raises InputError naming the file when it is none, damaged, or no regular volume."""
    dataset = read_file(path)
    if dataset is None or dataset.get("Modality") != "SEG":
        raise InputError(f"{path} is no DICOM segmentation; give the SEG file")
    with reading(path):
        kind = str(dataset.get("SegmentationType", ""))
        if kind not in _KINDS or not dataset.get("SegmentSequence"):
            raise InputError(f"{path} is a segmentation of type {kind!r} with no segments to read; export it again")
        if "PerFrameFunctionalGroupsSequence" not in dataset or "PixelData" not in dataset:
            raise InputError(f"{path} holds no frames with a place in the patient; export the segmentation again")
        slices = slices_of(DicomFile(path, dataset))
        if len(slices) != int(dataset.get("NumberOfFrames", 1)):
            raise InputError(f"{path} describes {len(slices)} frames but holds another number; export it again")
        segments = None if kind == "LABELMAP" else _segments_of_frames(dataset, path)
        numbers = _numbers(dataset)
        notes: list[str] = []
        spacing = _slice_spacing(dataset, slices, path, notes)
        full = float(dataset.get("MaximumFractionalValue") or 1) if kind == "FRACTIONAL" else 1.0
        origin = _what_it_was_drawn_on(dataset)
        heights = _heights(slices)
        fill_in(dataset, spacing, [int(k) for k in np.rint((heights - heights.min()) / spacing)], segments)
    tolerance = max(EVEN_WITHIN_MM, OFF_LATTICE * spacing)
    segmentation = _segmentation(dataset, path)
    geometry = _geometry(segmentation, tolerance, path)
    return DicomSegments(path, segmentation, origin, numbers, geometry, full, tolerance, tuple(notes))


def _segmentation(dataset: pydicom.Dataset, path: Path) -> Segmentation:
    try:
        with quiet():
            return Segmentation.from_dataset(dataset, copy=False)
    except _PIXEL_DAMAGE as error:
        raise InputError(f"{path} is a damaged segmentation; export it again") from error


def _geometry(segmentation: Segmentation, tolerance: float, path: Path) -> VolumeGeometry:
    try:
        with quiet():
            geometry = segmentation.get_volume_geometry(atol=tolerance)
    except _PIXEL_DAMAGE as error:
        raise InputError(f"{path} is a damaged segmentation; export it again") from error
    if geometry is None:
        raise InputError(f"{path} has frames with uneven gaps; resample the segmentation onto even slices")
    count, rows, columns = geometry.spatial_shape
    if rows * columns * count > MOST_VOXELS:
        raise InputError(f"{path} spans {columns} x {rows} x {count} voxels, which is too many; crop it")
    return geometry


def images_of(dataset: pydicom.Dataset) -> set[str]:
    """The SOP instances that a segmentation says it was drawn on."""
    return {
        str(image.get("ReferencedSOPInstanceUID", ""))
        for series in dataset.get("ReferencedSeriesSequence") or []
        for image in series.get("ReferencedInstanceSequence") or []
    }


def _numbers(dataset: pydicom.Dataset) -> dict[str, int]:
    items = [item for item in dataset.SegmentSequence if int(item.SegmentNumber) > 0]
    numbers = [int(item.SegmentNumber) for item in items]
    return dict(zip(distinct([_name(item) for item in items], numbers), numbers, strict=True))


def _name(item: pydicom.Dataset) -> str:
    """The segment's label, or what its codes mean where the label says nothing that is known here."""
    label = " ".join(str(item.get("SegmentLabel", "")).split())
    if organ_of(label):
        return label
    coded = []
    for kind in item.get("SegmentedPropertyTypeCodeSequence") or []:
        sides = kind.get("SegmentedPropertyTypeModifierCodeSequence") or []
        coded = [str(code.get("CodeMeaning", "")) for code in (kind, *sides)]
    meaning = " ".join(" ".join(coded).split())
    return meaning if organ_of(meaning) else label or meaning


def _segments_of_frames(dataset: pydicom.Dataset, path: Path) -> list[int]:
    shared = dataset.get("SharedFunctionalGroupsSequence") or [pydicom.Dataset()]
    found = []
    for group in dataset.PerFrameFunctionalGroupsSequence:
        items = group.get("SegmentIdentificationSequence") or shared[0].get("SegmentIdentificationSequence")
        if not items or items[0].get("ReferencedSegmentNumber") is None:
            raise InputError(f"{path} has a frame that belongs to no segment; export the segmentation again")
        found.append(int(items[0].ReferencedSegmentNumber))
    return found


def _what_it_was_drawn_on(dataset: pydicom.Dataset) -> pydicom.Dataset:
    """Patient and references, as the file states them."""
    found = pydicom.Dataset()
    for keyword in _REFERENCES:
        if keyword in dataset:
            found[keyword] = dataset[keyword]
    return found


def _slice_spacing(dataset: pydicom.Dataset, slices: list[Slice], path: Path, notes: list[str]) -> float:
    """mm from slice to slice on which all frames lie: what is stated, else the narrowest gap, else the slices' thickness.

    Empty frames may have been left out, so that the gaps are several slices wide.
    """
    first = slices[0]
    for other in slices:
        aside = other.origin - first.origin
        turned = max(np.abs(other.right - first.right).max(), np.abs(other.down - first.down).max())
        off = max(abs(aside @ first.right) / first.spacing[0], abs(aside @ first.down) / first.spacing[1])
        if other.shape != first.shape or turned > 1e-4 or off > OFF_LATTICE or other.spacing != first.spacing:
            raise InputError(f"{path} has frames that do not lie over each other; export the segmentation again")
    heights = _heights(slices)
    gaps = np.diff(np.unique(np.round(heights / SAME_PLANE_MM)) * SAME_PLANE_MM)
    stated = _stated(dataset, "SpacingBetweenSlices")
    narrowest = _refined(heights, float(gaps.min())) if len(gaps) else None
    for spacing in (stated, narrowest, _stated(dataset, "SliceThickness")):
        if spacing is None or not _on_lattice(heights, spacing):
            continue
        if stated is not None and spacing != stated:
            notes.append(f"slices are said to lie {stated:g} mm apart, but lie {spacing:g} mm apart, which was taken")
        return spacing
    if narrowest is None:
        return 1.0
    raise InputError(f"{path} has frames with uneven gaps; resample the segmentation onto even slices")


def _heights(slices: list[Slice]) -> FloatArray:
    """(n,) mm along the slices' normal."""
    return np.array([each.origin @ slices[0].normal for each in slices])


def _stated(dataset: pydicom.Dataset, keyword: str) -> float | None:
    """A length, mm, that is stated once for all frames."""
    found = {abs(float(item.get(keyword) or 0.0)) for item in pixel_measures(dataset)}
    only = found.pop() if len(found) == 1 else 0.0
    return only if SMALLEST_GAP_MM <= only < 1e3 else None


def _on_lattice(heights: FloatArray, spacing: float) -> bool:
    steps = (heights - heights.min()) / spacing
    return bool(np.abs(steps - np.rint(steps)).max() * spacing <= max(EVEN_WITHIN_MM, OFF_LATTICE * spacing))


def _refined(heights: FloatArray, gap: float) -> float:
    """The slice gap, from all positions: the narrowest one alone is as coarse as positions are rounded."""
    counts = np.rint((heights - heights.min()) / gap)
    return float(np.ptp(heights) / counts.max())
