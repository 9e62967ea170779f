"""What highdicom wants a segmentation to describe and reading its voxels does not need: filled in, so that nothing is refused for it."""

from __future__ import annotations

from collections.abc import Sequence

import pydicom
from highdicom.sr import CodedConcept
from pydicom.tag import Tag
from pydicom.uid import generate_uid

# What a segment shows is told by its name, which is read before.
_ANY_CODE = ("123037004", "SCT", "Anatomical Structure")
_CODES = ("SegmentedPropertyCategoryCodeSequence", "SegmentedPropertyTypeCodeSequence")
_DROPPED = (
    *("SegmentationAlgorithmIdentificationSequence", "AnatomicRegionSequence"),
    "SegmentedPropertyTypeModifierCodeSequence",
)
_UIDS = ("StudyInstanceUID", "SeriesInstanceUID", "SOPInstanceUID", "FrameOfReferenceUID")


def fill_in(dataset: pydicom.Dataset, spacing: float, planes: Sequence[int], segments: Sequence[int] | None) -> None:
    """Changes a segmentation's description so that highdicom reads it; its frames, places and pixels stay as they are.

    spacing : mm between slices. planes : of each frame its slice, from 0. segments : of each frame the number of its segment, None
    for a label map.
    """
    for keyword in _UIDS:
        if not dataset.get(keyword):
            setattr(dataset, keyword, generate_uid())
    for measures in pixel_measures(dataset):
        measures.SpacingBetweenSlices = measures.SliceThickness = f"{spacing:.10g}"
    for item in dataset.SegmentSequence:
        item.SegmentLabel, item.SegmentAlgorithmType = str(item.get("SegmentLabel") or "?"), "MANUAL"
        for keyword in _CODES:
            setattr(item, keyword, [CodedConcept(*_ANY_CODE)])
        for keyword in _DROPPED:
            item.pop(keyword, None)
    _index_frames(dataset, planes, segments)


def pixel_measures(dataset: pydicom.Dataset) -> list[pydicom.Dataset]:
    """The items that state pixel and slice spacing, of all frames."""
    groups = [
        *(dataset.get("SharedFunctionalGroupsSequence") or []),
        *(dataset.get("PerFrameFunctionalGroupsSequence") or []),
    ]
    return [item for group in groups for item in group.get("PixelMeasuresSequence") or []]


def _index_frames(dataset: pydicom.Dataset, planes: Sequence[int], segments: Sequence[int] | None) -> None:
    """The frames' dimensions (DICOM PS3.3 C.7.6.17): segment, where each frame has one, and place."""
    uid = generate_uid()
    pairs = [("PlanePositionSequence", "ImagePositionPatient")]
    if segments is not None:
        pairs.insert(0, ("SegmentIdentificationSequence", "ReferencedSegmentNumber"))
    dimensions = []
    for group, pointer in pairs:
        item = pydicom.Dataset()
        item.DimensionOrganizationUID = uid
        item.DimensionIndexPointer, item.FunctionalGroupPointer = Tag(pointer), Tag(group)
        dimensions.append(item)
    organization = pydicom.Dataset()
    organization.DimensionOrganizationUID = uid
    dataset.DimensionOrganizationSequence, dataset.DimensionIndexSequence = [organization], dimensions
    for at, (frame, plane) in enumerate(zip(dataset.PerFrameFunctionalGroupsSequence, planes, strict=True)):
        content = pydicom.Dataset()
        content.DimensionIndexValues = [plane + 1] if segments is None else [segments[at], plane + 1]
        frame.FrameContentSequence = [content]
