"""The labels of one state as a DICOM segmentation."""

from __future__ import annotations

from collections.abc import Mapping

import highdicom as hd
import numpy as np
from pydicom.sr.codedict import codes
from pydicom.uid import generate_uid

from palpate.case.case_folder import CaseFolder
from palpate.case.labels_on_scan import labels_in_own_frame
from palpate.case.surface_errors import segmentation_now
from palpate.core.errors import InputError
from palpate.imaging.labels import LABEL_COLOURS, LABELS
from palpate.imaging.volume import Volume
from palpate.ui.dicom.codes import OF_LABEL, TG263
from palpate.ui.dicom.making import MODEL, Making, making, version
from palpate.ui.dicom.source import SourceScan, read_source, set_thickness

_INPUTS = ("labels.txt", "segmentation.json", "alignment.json")


def segments_present(labels: Volume) -> dict[int, int]:
    """Label value -> segment number: those present, counted from 1 in the order of their values."""
    present = [int(value) for value in np.unique(labels.array) if value]
    return {value: number for number, value in enumerate(present, start=1)}


def label_segmentation(case: CaseFolder, state: str, tissue: bool = False) -> hd.seg.Segmentation:
    """The labels of a state on the voxels of that state's own CT, one binary segment each, named as the
    structures of an RTSTRUCT are.

    tissue : with the surrounding tissue, which is no organ. Raises InputError when the case has no labels or no CT of
    that state.
    """
    source = read_source(case, state)
    labels = labels_in_own_frame(case, state, tissue)
    if not labels.array.any():
        raise InputError(f"{case.file(state + '.nii.gz')} holds no organ within the {state} CT; look at the labels")
    kind = "seg" if state == "rest" else "deformed seg"
    made = making(case, kind, source, [f"{state}.nii.gz", *_INPUTS])
    return _segmentation(labels, source, made, algorithm_types(case, state), state)


def _segmentation(
    labels: Volume, source: SourceScan, made: Making, methods: Mapping[str, str], state: str
) -> hd.seg.Segmentation:
    numbers = segments_present(labels)
    table = np.zeros(max(LABELS) + 1, dtype=np.uint8)
    for value, number in numbers.items():
        table[value] = number
    found = hd.seg.Segmentation(
        source_images=source.images,
        pixel_array=source.placed(labels.with_array(table[labels.array])),
        segmentation_type=hd.seg.SegmentationTypeValues.BINARY,
        segment_descriptions=[_described(value, number, made, methods) for value, number in numbers.items()],
        content_label="LABELS",
        content_description="Research use only: organs for stiffness from two CT scans",
        series_description=made.series_description(f"labels, {state}"),
        **made.equipment(),
    )
    for value, item in zip(numbers, found.SegmentSequence, strict=True):
        item.SegmentDescription = made.note[:1024]
        side = OF_LABEL[value][2]
        if side is not None:
            item.SegmentedPropertyTypeCodeSequence[0].SegmentedPropertyTypeModifierCodeSequence = [
                hd.sr.CodedConcept.from_code(side)
            ]
    found.BodyPartExamined = source.body_part
    set_thickness(found, labels)
    made.stamp(found)
    return found


def _described(value: int, number: int, made: Making, methods: Mapping[str, str]) -> hd.seg.SegmentDescription:
    category, kind, _ = OF_LABEL[value]
    method = methods.get(LABELS[value], "MANUAL")
    algorithm = hd.AlgorithmIdentificationSequence(f"{MODEL} segment", codes.DCM.EdgeDetection, version())
    red, green, blue, _ = LABEL_COLOURS[value]
    return hd.seg.SegmentDescription(
        segment_number=number,
        segment_label=TG263[value],
        segmented_property_category=category,
        segmented_property_type=kind,
        algorithm_type=method,
        algorithm_identification=None if method == "MANUAL" else algorithm,
        tracking_uid=generate_uid(entropy_srcs=[made.sop_uid, LABELS[value]]),
        tracking_id=LABELS[value],
        display_color=hd.color.CIELabColor.from_rgb(red, green, blue),
    )


def algorithm_types(case: CaseFolder, state: str) -> dict[str, str]:
    """How each label came about, in DICOM's words; what this program did not find was drawn."""
    known = segmentation_now(case).get("states", {}).get(state, {})
    organs = {name: str(entry.get("method", "")) for name, entry in known.get("organs", {}).items()}
    words = {name: _algorithm_type(method) for name, method in organs.items()}
    found = {f"prostate_{side}": words["prostate"] for side in ("left", "right") if "prostate" in words}
    found |= {name: words[name] for name in ("bladder", "rectum") if name in words}
    if known.get("organs"):
        found |= {"bone": "AUTOMATIC", "surrounding_tissue": "AUTOMATIC"}
    return found


def _algorithm_type(method: str) -> str:
    if method == "auto":
        return "AUTOMATIC"
    return "MANUAL" if method in ("user", "drawn") else "SEMIAUTOMATIC"
