"""DICOM segmentations: segments by name on the grid of their frames."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pydicom
from pydicom.pixels import iter_pixels

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.imaging.contours.named_labels import label_named, unique
from palpate.imaging.contours.nifti_labels import MOST_VOXELS
from palpate.imaging.contours.roi_names import organ_of
from palpate.imaging.dicom.files import DAMAGE, DicomFile, quiet, read_file, reading
from palpate.imaging.dicom.slices import Slice, slices_of
from palpate.imaging.volume import Volume

# Frames at positions nearer than this are of one slice; frames further from the lattice than this share of it are uneven.
SAME_PLANE_MM = 0.01
OFF_LATTICE = 0.05
_KINDS = ("BINARY", "FRACTIONAL", "LABELMAP")
# What decoding damaged pixels raises beside what reading elements does.
_PIXEL_DAMAGE = (*DAMAGE, IndexError, OverflowError, ZeroDivisionError, MemoryError)


@dataclass(frozen=True, eq=False)
class DicomSegments:
    """A DICOM SEG. frames : of each frame its segment's number (0: a label map's) and its slice on the grid.

    full : the stored value that is certain, of a fractional one.
    """

    path: Path
    dataset: pydicom.Dataset
    numbers: dict[str, int]
    frames: list[tuple[int, int]]
    shape: tuple[int, int, int]
    affine: FloatArray
    full: float

    @property
    def names(self) -> list[str]:
        """Of the segments."""
        return list(self.numbers)

    @cached_property
    def grid(self) -> Volume:
        """An empty volume on which all frames lie."""
        return Volume(np.zeros(self.shape, dtype=np.uint8), self.affine)

    def mask(self, name: str) -> BoolArray:
        """The voxels of a segment; those at least half certain of a fractional one."""
        number = self.numbers[name]
        wanted = [index for index, (of, _) in enumerate(self.frames) if of in (0, number)]
        found = np.zeros(self.shape, dtype=bool)
        try:
            with quiet():
                for index, pixels in zip(wanted, iter_pixels(self.dataset, indices=wanted), strict=True):
                    of, k = self.frames[index]
                    inside = pixels == number if of == 0 else pixels >= max(0.5 * self.full, 0.5)
                    found[:, :, k] |= inside.T
        except _PIXEL_DAMAGE as error:
            raise InputError(f"{self.path} has pixels that cannot be decoded; export the segmentation again") from error
        return found


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
        numbers = _numbers(dataset)
        segments = [0] * len(slices) if kind == "LABELMAP" else _segment_of_frames(dataset, path)
        shape, affine, planes = _lattice(slices, path)
        full = float(dataset.get("MaximumFractionalValue") or 1) if kind == "FRACTIONAL" else 1.0
    return DicomSegments(path, dataset, numbers, list(zip(segments, planes, strict=True)), shape, affine, full)


def images_of(dataset: pydicom.Dataset) -> set[str]:
    """The SOP instances that a segmentation says it was drawn on."""
    return {
        str(image.get("ReferencedSOPInstanceUID", ""))
        for series in dataset.get("ReferencedSeriesSequence") or []
        for image in series.get("ReferencedInstanceSequence") or []
    }


def _numbers(dataset: pydicom.Dataset) -> dict[str, int]:
    items = [item for item in dataset.SegmentSequence if int(item.SegmentNumber) > 0]
    return dict(zip(unique([_name(item) for item in items]), (int(i.SegmentNumber) for i in items), strict=True))


def _name(item: pydicom.Dataset) -> str:
    """The segment's label, or what its codes mean where the label says nothing that is known here."""
    label = " ".join(str(item.get("SegmentLabel", "")).split())
    if label_named(label) or organ_of(label):
        return label
    coded = []
    for kind in item.get("SegmentedPropertyTypeCodeSequence") or []:
        sides = kind.get("SegmentedPropertyTypeModifierCodeSequence") or []
        coded = [str(code.get("CodeMeaning", "")) for code in (kind, *sides)]
    meaning = " ".join(" ".join(coded).split())
    return meaning if organ_of(meaning) else label or meaning


def _segment_of_frames(dataset: pydicom.Dataset, path: Path) -> list[int]:
    shared = dataset.get("SharedFunctionalGroupsSequence") or [pydicom.Dataset()]
    found = []
    for group in dataset.PerFrameFunctionalGroupsSequence:
        items = group.get("SegmentIdentificationSequence") or shared[0].get("SegmentIdentificationSequence")
        if not items or items[0].get("ReferencedSegmentNumber") is None:
            raise InputError(f"{path} has a frame that belongs to no segment; export the segmentation again")
        found.append(int(items[0].ReferencedSegmentNumber))
    return found


def _lattice(slices: list[Slice], path: Path) -> tuple[tuple[int, int, int], FloatArray, list[int]]:
    """Shape and affine (4, 4) of the grid, and of each frame its index along k."""
    first = slices[0]
    for other in slices:
        aside = other.origin - first.origin
        turned = max(np.abs(other.right - first.right).max(), np.abs(other.down - first.down).max())
        off = max(abs(aside @ first.right) / first.spacing[0], abs(aside @ first.down) / first.spacing[1])
        if other.shape != first.shape or turned > 1e-4 or off > OFF_LATTICE or other.spacing != first.spacing:
            raise InputError(f"{path} has frames that do not lie over each other; export the segmentation again")
    heights = np.array([each.origin @ first.normal for each in slices])
    low, gaps = heights.min(), np.diff(np.unique(np.round(heights / SAME_PLANE_MM)) * SAME_PLANE_MM)
    # Empty frames may have been left out, so the narrowest gap is one slice and wider ones are several.
    step = _refined(heights, float(gaps.min())) if len(gaps) else 1.0
    planes = np.rint((heights - low) / step)
    if np.abs((heights - low) / step - planes).max() > OFF_LATTICE * max(1.0, 0.02 * planes.max()):
        raise InputError(f"{path} has frames with uneven gaps; resample the segmentation onto even slices")
    rows, columns = first.shape
    count = int(planes.max()) + 1
    if rows * columns * count > MOST_VOXELS:
        raise InputError(f"{path} spans {columns} x {rows} x {count} voxels, which is too many; crop it")
    affine = np.eye(4)
    affine[:3, 0], affine[:3, 1] = first.right * first.spacing[0], first.down * first.spacing[1]
    affine[:3, 2], affine[:3, 3] = first.normal * step, first.origin + first.normal * (low - heights[0])
    return (columns, rows, count), affine, [int(k) for k in planes]


def _refined(heights: FloatArray, gap: float) -> float:
    """The slice gap, from all positions: the narrowest one alone is as coarse as positions are rounded."""
    counts = np.rint((heights - heights.min()) / gap)
    return float(np.ptp(heights) / counts.max())
