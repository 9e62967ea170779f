"""For PACS and planning systems: the alignment of the two scans as a DICOM spatial registration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydicom import Dataset
from pydicom.dataset import FileDataset
from pydicom.sr.codedict import codes
from pydicom.uid import SpatialRegistrationStorage
from pydicom.valuerep import DA, TM, DSfloat

from palpate.case.case_folder import STATES, CaseFolder
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.ui.dicom.making import Making, begun, making, save
from palpate.ui.dicom.source import SourceScan, read_source, reference_to

WRITES = "DICOM Spatial Registration: the rigid alignment on bone that brings the deformed scan onto the one at rest"
_ALIGNMENT = "alignment.json"


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes registration.dcm: of both frames of reference the matrix that brings its points into that of the scan at rest.

    Raises InputError when the case has no alignment or lacks one of the CTs, when both scans state one frame of
    reference, or it cannot write.
    """
    if not case.has(_ALIGNMENT):
        raise InputError(f"{case.file(_ALIGNMENT)} is not there: import two scans as DICOM, which aligns them")
    scans = {state: read_source(case, state) for state in STATES}
    frames = {state: str(scan.header.FrameOfReferenceUID) for state, scan in scans.items()}
    if frames["rest"] == frames["deformed"] and not np.allclose(case.deformed_to_rest(), np.eye(4), atol=1e-6):
        raise InputError(
            f"{case.path}: both scans state one frame of reference, within which a DICOM registration cannot distinguish "
            "them; use --to transform"
        )
    made = making(case, "reg", scans["rest"], [_ALIGNMENT])
    data = _registration(scans["rest"], made)
    matrices = {"rest": np.eye(4), "deformed": case.deformed_to_rest()}
    data.RegistrationSequence = [_item_of(scans[state], matrices[state]) for state in STATES]
    data.ReferencedSeriesSequence = [_series_of(scans["rest"])]
    if scans["rest"].header.StudyInstanceUID == scans["deformed"].header.StudyInstanceUID:
        data.ReferencedSeriesSequence.append(_series_of(scans["deformed"]))
    else:
        other = Dataset()
        other.StudyInstanceUID = scans["deformed"].header.StudyInstanceUID
        other.ReferencedSeriesSequence = [_series_of(scans["deformed"])]
        data.StudiesContainingOtherReferencedInstancesSequence = [other]
    made.stamp(data)
    return [save(data, folder / "registration.dcm")]


def _registration(source: SourceScan, made: Making) -> FileDataset:
    data = begun(SpatialRegistrationStorage, made.sop_uid, source, made)
    data.Modality, data.InstanceNumber = "REG", 1
    data.SeriesDescription = made.series_description("alignment on bone")
    data.DeviceSerialNumber = data.SoftwareVersions
    data.FrameOfReferenceUID, data.PositionReferenceIndicator = source.header.FrameOfReferenceUID, ""
    data.ContentDate, data.ContentTime = DA(made.made.date()), TM(made.made.time())
    data.ContentLabel, data.ContentDescription = "ALIGNMENT", "Research use only: deformed scan onto rest, bones"
    data.ContentCreatorName = ""
    data.BodyPartExamined = source.body_part
    return data


def _item_of(scan: SourceScan, to_rest: FloatArray) -> Dataset:
    """One frame of reference: its images, and the matrix that brings its points into the registration's own."""
    matrix = Dataset()
    matrix.FrameOfReferenceTransformationMatrix = [DSfloat(float(x), auto_format=True) for x in to_rest.ravel()]
    matrix.FrameOfReferenceTransformationMatrixType = "RIGID"
    kind = Dataset()
    kind.CodeValue, kind.CodingSchemeDesignator, kind.CodeMeaning = (
        codes.DCM.ImageContentBasedAlignment.value, "DCM", codes.DCM.ImageContentBasedAlignment.meaning,
    )  # fmt: skip
    step = Dataset()
    step.RegistrationTypeCodeSequence, step.MatrixSequence = [kind], [matrix]
    item = Dataset()
    item.FrameOfReferenceUID = scan.header.FrameOfReferenceUID
    item.ReferencedImageSequence = [reference_to(image) for image in scan.images]
    item.MatrixRegistrationSequence = [step]
    return item


def _series_of(scan: SourceScan) -> Dataset:
    item = Dataset()
    item.SeriesInstanceUID = scan.header.SeriesInstanceUID
    item.ReferencedInstanceSequence = [reference_to(image) for image in scan.images]
    return item
