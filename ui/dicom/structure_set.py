"""The organs of one state as a DICOM RT structure set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydicom import Dataset
from pydicom.dataset import FileDataset
from pydicom.uid import RTStructureSetStorage
from pydicom.valuerep import DA, TM

from palpate.case.case_folder import CaseFolder
from palpate.core.arrays import FloatArray
from palpate.imaging.contours.outlines import outlines
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume
from palpate.ui.dicom.making import Making, begun, making
from palpate.ui.dicom.source import SourceScan, read_source, reference_to
from palpate.ui.dicom.structures import structures

_STUDY_CLASS = "1.2.840.10008.3.1.2.3.1"  # Detached Study Management, retired, which this sequence still asks for


def structure_set(case: CaseFolder, state: str, tissue: bool = False) -> FileDataset:
    """Contours of a state's organs on the slices of its own CT, named as AAPM TG-263 asks (`structures`).

    Holes are contours within contours. tissue : with the surrounding tissue, which is no organ.
    Raises InputError when the case has no labels or no CT of that state.
    """
    source = read_source(case, state)
    kind = "rtstruct" if state == "rest" else "deformed rtstruct"
    made = making(case, kind, source, [f"{state}.nii.gz", "labels.txt", "alignment.json", "segmentation.json"])
    ct, facts = case.series(state)
    data = _empty(source, made, state)
    for number, structure in enumerate(structures(case, state, ct, tissue), start=1):
        contours = _contours(structure.mask, structure.first_slice, facts)
        data.StructureSetROISequence.append(_item(
            ROINumber=number, ReferencedFrameOfReferenceUID=source.header.FrameOfReferenceUID, ROIName=structure.name,
            ROIDescription=structure.description, ROIGenerationAlgorithm=structure.algorithm,
        ))  # fmt: skip
        data.ROIContourSequence.append(
            _item(ROIDisplayColor=list(structure.colour), ContourSequence=contours, ReferencedROINumber=number)
        )
        data.RTROIObservationsSequence.append(_item(
            ObservationNumber=number, ReferencedROINumber=number, RTROIInterpretedType=structure.kind, ROIInterpreter="",
        ))  # fmt: skip
    made.stamp(data)
    return data


def _contours(drawn: Volume, first: int, facts: SeriesFacts) -> list[Dataset]:
    found = []
    for k in np.flatnonzero(drawn.array.any(axis=(0, 1))):
        for outline in outlines(drawn.array[:, :, k] > 0):
            points = drawn.to_lps(np.column_stack([outline, np.full(len(outline), float(k))]))
            contour = _item(
                ContourGeometricType="CLOSED_PLANAR", NumberOfContourPoints=len(points), ContourData=_text(points)
            )
            if not facts.regridded:
                image = _item(
                    ReferencedSOPClassUID=facts.sop_class_uid, ReferencedSOPInstanceUID=facts.sop_uids[first + int(k)]
                )
                if facts.sop_uids.count(image.ReferencedSOPInstanceUID) > 1:
                    image.ReferencedFrameNumber = facts.frames[first + int(k)] + 1
                contour.ContourImageSequence = [image]
            found.append(contour)
    return found


def _text(points: FloatArray) -> list[str]:
    """Decimal strings of at most 16 characters, micrometres."""
    return [f"{value:.3f}" for value in points.ravel() + 0.0]


def _empty(source: SourceScan, made: Making, state: str) -> FileDataset:
    data = begun(RTStructureSetStorage, made.sop_uid, source, made)
    data.Modality, data.OperatorsName = "RTSTRUCT", ""
    data.SeriesDescription = made.series_description(f"structures, {state}")
    data.FrameOfReferenceUID, data.PositionReferenceIndicator = source.header.FrameOfReferenceUID, ""
    data.InstanceNumber, data.StructureSetLabel, data.StructureSetName = 1, "PALPATE", f"Palpate, {state}"
    data.StructureSetDescription = made.note
    data.StructureSetDate, data.StructureSetTime = DA(made.made.date()), TM(made.made.time())
    data.ApprovalStatus = "UNAPPROVED"
    header = source.header
    series = _item(
        SeriesInstanceUID=header.SeriesInstanceUID,
        ContourImageSequence=[reference_to(image) for image in source.images],
    )
    study = _item(ReferencedSOPClassUID=_STUDY_CLASS, ReferencedSOPInstanceUID=header.StudyInstanceUID,
                  RTReferencedSeriesSequence=[series])  # fmt: skip
    data.ReferencedFrameOfReferenceSequence = [
        _item(FrameOfReferenceUID=header.FrameOfReferenceUID, RTReferencedStudySequence=[study])
    ]
    data.StructureSetROISequence, data.ROIContourSequence, data.RTROIObservationsSequence = [], [], []
    return data


def _item(**elements: str | int | Sequence[str | int | Dataset]) -> Dataset:
    item = Dataset()
    for keyword, value in elements.items():
        setattr(item, keyword, value)
    return item
