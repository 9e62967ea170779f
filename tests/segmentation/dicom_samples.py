"""DICOM series and structure sets made for tests: small, asymmetric, and as odd as a test wants them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence as DicomSequence
from pydicom.uid import (
    UID,
    CTImageStorage,
    EnhancedCTImageStorage,
    ExplicitVRLittleEndian,
    RTStructureSetStorage,
    generate_uid,
)

ROWS, COLUMNS = 24, 20
ROW_SPACING, COLUMN_SPACING = 2.0, 1.5
HEAD_FIRST_SUPINE = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
PATIENT_NAME, PATIENT_ID = "Rossi^Mario", "X-4711"


def hounsfield(lps: NDArray[np.float64]) -> NDArray[np.float64]:
    """A smooth field without any symmetry, HU, at points (..., 3) mm: what a perfect scanner would see."""
    x, y, z = np.moveaxis(np.asarray(lps, dtype=float), -1, 0)
    return 40.0 + 6.0 * x - 4.0 * y + 9.0 * z + 0.08 * x * y - 0.05 * y * z + 0.03 * x * z


def slice_points(orientation: Sequence[float], origin: Sequence[float]) -> NDArray[np.float64]:
    """Patient coordinates (ROWS, COLUMNS, 3) mm of a slice's pixels."""
    right, down = np.array(orientation[:3]), np.array(orientation[3:])
    j, i = np.mgrid[:ROWS, :COLUMNS].astype(float)
    return np.array(origin) + i[..., None] * COLUMN_SPACING * right + j[..., None] * ROW_SPACING * down


def ct_slice(
    origin: Sequence[float],
    number: int,
    orientation: Sequence[float] = HEAD_FIRST_SUPINE,
    series: str = "1.2.3.1",
    slope: float = 1.0,
    intercept: float = -1024.0,
    values: Callable[[NDArray[np.float64]], NDArray[np.float64]] = hounsfield,
) -> FileDataset:
    """One CT slice that shows ``values`` at its place."""
    stored = np.rint((values(slice_points(orientation, origin)) - intercept) / slope)
    dataset = _object(CTImageStorage, "CT")
    dataset.SeriesInstanceUID = series
    dataset.FrameOfReferenceUID = series + ".9"
    dataset.InstanceNumber = number
    dataset.ImageType = ["ORIGINAL", "PRIMARY", "AXIAL"]
    dataset.PatientPosition = "HFS"
    dataset.ImageOrientationPatient = [f"{v:.10g}" for v in orientation]
    dataset.ImagePositionPatient = [f"{v:.8g}" for v in origin]
    dataset.PixelSpacing = [ROW_SPACING, COLUMN_SPACING]
    dataset.RescaleSlope, dataset.RescaleIntercept = slope, intercept
    _set_pixels(dataset, stored)
    return dataset


def series(positions: Sequence[Sequence[float]], **options: Any) -> list[FileDataset]:
    """Slices at the given origins."""
    return [ct_slice(origin, number, **options) for number, origin in enumerate(positions, start=1)]


def straight(count: int = 6, gap: float = 3.0) -> list[tuple[float, float, float]]:
    """Origins of an upright stack."""
    return [(-11.0, -7.0, 5.0 + gap * k) for k in range(count)]


def save(folder: Path, slices: Sequence[FileDataset]) -> Path:
    """Writes slices under names whose order is not that of the positions."""
    folder.mkdir(parents=True, exist_ok=True)
    order = np.random.default_rng(3).permutation(len(slices))
    for name, index in enumerate(order):
        slices[index].save_as(folder / f"im_{name:03d}.dcm", enforce_file_format=True)
    return folder


def enhanced_ct(positions: Sequence[Sequence[float]]) -> FileDataset:
    """An enhanced multi-frame CT; the second half of the frames has another rescale intercept."""
    dataset = _object(EnhancedCTImageStorage, "CT")
    dataset.SeriesInstanceUID, dataset.FrameOfReferenceUID = "1.2.3.7", "1.2.3.8"
    dataset.ImageType = ["ORIGINAL", "PRIMARY", "VOLUME", "NONE"]
    dataset.NumberOfFrames = len(positions)
    shared = Dataset()
    shared.PlaneOrientationSequence = _one(ImageOrientationPatient=list(HEAD_FIRST_SUPINE))
    shared.PixelMeasuresSequence = _one(PixelSpacing=[ROW_SPACING, COLUMN_SPACING])
    dataset.SharedFunctionalGroupsSequence = DicomSequence([shared])
    frames, stored = [], []
    for index, origin in enumerate(positions):
        intercept = -1024.0 if 2 * index < len(positions) else -2048.0
        frame = Dataset()
        frame.PlanePositionSequence = _one(ImagePositionPatient=list(origin))
        frame.PixelValueTransformationSequence = _one(RescaleSlope=1, RescaleIntercept=intercept, RescaleType="HU")
        frames.append(frame)
        stored.append(hounsfield(slice_points(HEAD_FIRST_SUPINE, origin)) - intercept)
    dataset.PerFrameFunctionalGroupsSequence = DicomSequence(frames)
    _set_pixels(dataset, np.rint(np.array(stored)))
    return dataset


def structure_set(
    structures: dict[str, list[NDArray[np.float64]]], frame_of_reference: str = "1.2.3.1.9"
) -> FileDataset:
    """An RTSTRUCT of named lists of closed contours, each (n, 3) mm."""
    dataset = _object(RTStructureSetStorage, "RTSTRUCT")
    dataset.FrameOfReferenceUID = frame_of_reference
    dataset.StructureSetROISequence, dataset.ROIContourSequence = DicomSequence(), DicomSequence()
    for number, (name, contours) in enumerate(structures.items(), start=1):
        dataset.StructureSetROISequence.append(_dataset(ROINumber=number, ROIName=name))
        items = [
            _dataset(
                ContourGeometricType="CLOSED_PLANAR",
                NumberOfContourPoints=len(c),
                ContourData=[f"{v:.5f}" for v in c.ravel()],
            )
            for c in contours
        ]
        roi = _dataset(ReferencedROINumber=number)
        roi.ContourSequence = DicomSequence(items)
        dataset.ROIContourSequence.append(roi)
    return dataset


def _object(sop_class: UID, modality: str) -> FileDataset:
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = sop_class, generate_uid()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    dataset = FileDataset("", {}, file_meta=meta, preamble=b"\0" * 128)
    dataset.SOPClassUID, dataset.SOPInstanceUID = sop_class, meta.MediaStorageSOPInstanceUID
    dataset.Modality = modality
    dataset.PatientName, dataset.PatientID, dataset.PatientBirthDate = PATIENT_NAME, PATIENT_ID, "19500101"
    dataset.StudyInstanceUID, dataset.StudyDate = "1.2.3", "20240102"
    return dataset


def _set_pixels(dataset: Dataset, stored: NDArray[np.float64]) -> None:
    dataset.Rows, dataset.Columns = stored.shape[-2:]
    dataset.SamplesPerPixel, dataset.PhotometricInterpretation = 1, "MONOCHROME2"
    dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit, dataset.PixelRepresentation = 16, 16, 15, 0
    dataset.PixelData = stored.astype("<u2").tobytes()


def _dataset(**elements: Any) -> Dataset:
    dataset = Dataset()
    for keyword, value in elements.items():
        setattr(dataset, keyword, value)
    return dataset


def _one(**elements: Any) -> DicomSequence:
    return DicomSequence([_dataset(**elements)])
