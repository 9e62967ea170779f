"""Writing a volume as a DICOM CT series: complete, valid (dciodvfy), losslessly compressed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydicom.dataset import FileDataset, FileMetaDataset
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, JPEG2000Lossless, generate_uid

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_folder
from palpate.imaging.volume import Volume

# OpenJPEG halves a picture five times, so smaller ones stay uncompressed.
SMALLEST_COMPRESSED = 32
# Stored values are HU + 1024 in 12 bits, as scanners write them.
INTERCEPT_HU = -1024
BITS = 12


@dataclass(frozen=True)
class SeriesIdentity:
    """Whose scan a written series is, and which.

    patient_id, patient_name : made up, or a research number; never a person's. study, frame_of_reference, series : words
    from which the UIDs are made, so that the same words give the same UIDs and other words others. number : SeriesNumber.
    date, time : YYYYMMDD, HHMMSS. derivation : how the pixels came about; ImageType says DERIVED, as no scanner made them.
    """

    patient_id: str
    patient_name: str
    study: str
    series: str
    frame_of_reference: str
    number: int
    study_description: str
    series_description: str
    derivation: str
    date: str = "20240101"
    time: str = "120000"


def write_ct_series(folder: Path, volume: Volume, identity: SeriesIdentity, compress: bool = True) -> list[Path]:
    """Writes a CT (ni, nj, nk) in HU as one file per slice in a new or replaced folder; all or nothing.

    Rows run along i, columns along j; values are rounded and cut to -1024 .. 3071 HU. compress : JPEG 2000 lossless, from 32 x 32
    pixels on.
    Returns the paths from lowest k to highest. Raises InputError when the grid is not right-angled or too small, or
    the folder cannot be written.
    """
    volume = right_handed(volume)
    stored = np.rint(np.clip(volume.array, INTERCEPT_HU, INTERCEPT_HU + 2**BITS - 1)) - INTERCEPT_HU
    pixels = np.ascontiguousarray(np.transpose(stored.astype(np.uint16), (2, 1, 0)))
    names = [f"CT_{number:03d}.dcm" for number in range(1, len(pixels) + 1)]
    with atomic_folder(folder) as temporary:
        for index, name in enumerate(names):
            _slice(volume, pixels[index], index, identity, compress).save_as(temporary / name, enforce_file_format=True)
    return [folder / name for name in names]


def right_handed(volume: Volume) -> Volume:
    """The same voxels in the same places with slices in the order that a DICOM series has. Raises InputError as ``write_ct_series``."""
    directions = volume.affine[:3, :3] / volume.spacing
    if np.abs(directions.T @ directions - np.eye(3)).max() > 1e-4:
        raise InputError("the CT's grid is not right-angled, which a DICOM series must be; resample it first")
    if volume.array.ndim != 3 or min(volume.array.shape) < 3:
        raise InputError(
            f"a CT of shape {volume.array.shape} is no series; at least 3 voxels along each axis are needed"
        )
    if np.linalg.det(directions) > 0:
        return volume
    affine = volume.affine.copy()
    affine[:3, 3] += affine[:3, 2] * (volume.array.shape[2] - 1)
    affine[:3, 2] *= -1
    return Volume(volume.array[:, :, ::-1], affine)


def _slice(
    volume: Volume, pixels: NDArray[np.uint16], index: int, identity: SeriesIdentity, compress: bool
) -> FileDataset:
    uid = generate_uid(entropy_srcs=[identity.series, identity.study, identity.patient_id, "slice", str(index)])
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = CTImageStorage
    meta.MediaStorageSOPInstanceUID = uid
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data = FileDataset("", {}, file_meta=meta, preamble=b"\0" * 128)
    data.SOPClassUID, data.SOPInstanceUID = CTImageStorage, uid
    data.InstanceNumber = index + 1
    _add_who(data, identity)
    _add_how(data, identity)
    place_slice(data, volume, index)
    _add_pixels(data, pixels, compress)
    return data


def _add_who(data: FileDataset, identity: SeriesIdentity) -> None:
    data.SpecificCharacterSet = "ISO_IR 100"
    data.PatientName, data.PatientID = identity.patient_name, identity.patient_id
    data.PatientBirthDate, data.PatientSex = "", "M"
    data.PatientIdentityRemoved = "YES"
    data.DeidentificationMethod = "No real person, or identity replaced by a research number"
    data.StudyInstanceUID = generate_uid(entropy_srcs=[identity.study, identity.patient_id, "study"])
    data.SeriesInstanceUID = generate_uid(entropy_srcs=[identity.series, identity.study, identity.patient_id, "series"])
    data.FrameOfReferenceUID = generate_uid(entropy_srcs=[identity.frame_of_reference, identity.patient_id, "frame"])
    data.PositionReferenceIndicator = ""
    data.StudyID, data.SeriesNumber, data.AcquisitionNumber = str(identity.number), identity.number, 1
    data.StudyDescription, data.SeriesDescription = identity.study_description, identity.series_description
    data.AccessionNumber, data.ReferringPhysicianName = "", ""
    for kind in ("Study", "Series", "Acquisition", "Content"):
        setattr(data, f"{kind}Date", identity.date)
        setattr(data, f"{kind}Time", identity.time)


def _add_how(data: FileDataset, identity: SeriesIdentity) -> None:
    data.ImageType = ["DERIVED", "SECONDARY", "AXIAL"]
    data.Modality, data.Manufacturer, data.ManufacturerModelName = "CT", "Palpate", "simulate"
    data.BodyPartExamined, data.PatientPosition = "PELVIS", "HFS"
    data.KVP, data.ConvolutionKernel = "120", "STANDARD"
    data.DerivationDescription = identity.derivation


def place_slice(data: FileDataset, volume: Volume, index: int) -> None:
    """States where slice k = index of a right-handed volume lies: rows along i, columns along j; mm, patient coordinates."""
    spacing = volume.spacing
    right, down = (volume.affine[:3, axis] / spacing[axis] for axis in (0, 1))
    corner = volume.to_lps(np.array([[0.0, 0.0, index]]))[0]
    data.ImageOrientationPatient = _decimals([*right, *down], 10)
    data.ImagePositionPatient = _decimals(corner, 6)
    data.PixelSpacing = _decimals([spacing[1], spacing[0]], 6)
    data.SliceThickness = _decimals([spacing[2]], 6)[0]
    data.SliceLocation = _decimals([corner @ np.cross(right, down)], 4)[0]


def _add_pixels(data: FileDataset, pixels: NDArray[np.uint16], compress: bool) -> None:
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.Rows, data.Columns = pixels.shape
    data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, BITS, BITS - 1, 0
    data.RescaleIntercept, data.RescaleSlope, data.RescaleType = INTERCEPT_HU, 1, "HU"
    data.WindowCenter, data.WindowWidth = 40, 400
    data.PixelData = pixels.tobytes()
    if compress and min(pixels.shape) >= SMALLEST_COMPRESSED:
        data.compress(JPEG2000Lossless, generate_instance_uid=False)


def _decimals(values: Sequence[float] | FloatArray, places: int) -> list[str]:
    """Decimal strings of at most 16 characters, as DICOM's DS demands; without a minus before zero."""
    return [f"{round(float(v), places) + 0.0:.{places}f}"[:16].rstrip("0").rstrip(".") for v in values]
