"""For PACS: the report as an encapsulated PDF."""

from __future__ import annotations

from pathlib import Path

from highdicom.sr import CodedConcept
from pydicom.dataset import FileDataset
from pydicom.sr.codedict import codes
from pydicom.uid import EncapsulatedPDFStorage
from pydicom.valuerep import DA, DT, TM

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.ui.dicom.making import MARK, Making, begun, making, save
from palpate.ui.dicom.source import SourceScan, read_source, reference_to

WRITES = "DICOM encapsulated PDF: the report"
_REPORT = "report/report.pdf"


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes report_pdf.dcm. Raises InputError when the case has no PDF report or no CT at rest, or it cannot write."""
    path = case.file(_REPORT)
    if not path.is_file():
        raise InputError(f"{path} is not there; run `palpate report` first")
    source = read_source(case, "rest")
    made = making(case, "pdf", source, [_REPORT])
    return [save(_encapsulated(path.read_bytes(), source, made), folder / "report_pdf.dcm")]


def _encapsulated(pdf: bytes, source: SourceScan, made: Making) -> FileDataset:
    data = begun(EncapsulatedPDFStorage, made.sop_uid, source, made)
    data.Modality = "DOC"
    data.SeriesDescription = made.series_description("stiffness report")
    data.ConversionType, data.InstanceNumber = "WSD", 1
    data.ContentDate, data.ContentTime = DA(made.made.date()), TM(made.made.time())
    data.AcquisitionDateTime = DT(made.made)
    # The pages carry no identity of their own, but a case's name that a person chose: whoever removes identities must look.
    data.BurnedInAnnotation = "YES"
    data.DocumentTitle = f"Stiffness from two CT scans. {MARK}, not for diagnosis"
    data.ConceptNameCodeSequence = [CodedConcept.from_code(codes.DCM.ImagingMeasurementReport)]
    data.VerificationFlag = "UNVERIFIED"
    data.SourceInstanceSequence = [reference_to(image) for image in source.images]
    data.MIMETypeOfEncapsulatedDocument = "application/pdf"
    data.EncapsulatedDocumentLength = len(pdf)
    data.EncapsulatedDocument = pdf + b"\0" * (len(pdf) % 2)
    made.stamp(data)
    return data
