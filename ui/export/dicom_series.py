"""For viewers that know no DICOM parametric map, and for SimpleITK: stiffness in kPa as a series of single slices."""

from __future__ import annotations

from pathlib import Path

import highdicom as hd
import numpy as np
from numpy.typing import NDArray
from pydicom.dataset import FileDataset
from pydicom.uid import SecondaryCaptureImageStorage, generate_uid

from palpate.case.case_folder import CaseFolder
from palpate.core.arrays import FloatArray
from palpate.core.files.atomic import atomic_folder
from palpate.imaging.dicom.write import place_slice, right_handed
from palpate.ui.dicom.codes import KILOPASCAL, SHEAR_MODULUS
from palpate.ui.dicom.making import Making, begun, making
from palpate.ui.dicom.source import SourceScan, read_source, reference_to
from palpate.ui.export.stiffness import near_organ, stiffness_volume

WRITES = "DICOM Secondary Capture, slice by slice, for programs without Parametric Map: shear modulus G in kPa; not for planning"
FOLDER = "stiffness_series"
# kPa per stored unit: the finest that holds the stiffest region in 16 bits.
_STEPS_KPA = (0.001, 0.01, 0.1, 1.0, 10.0)
_LARGEST = 2**16 - 1
# A direction closer to a plane than this part of its length has no letter off that plane.
_ALONG = 0.01
_WARNING = "Shear modulus G in kPa from two CT scans of one organ; no Hounsfield units, not for planning"


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes stiffness_series/G_001.dcm ... Raises InputError when the case has no result or no CT at rest, or it cannot write.

    Secondary Capture in a frame of reference of its own: a planning system takes neither for a CT, and kPa never for
    Hounsfield units. Positions are those of the CT all the same. Values are rounded to the step that RescaleSlope states;
    the real-world mapping says what they are.
    """
    G = right_handed(near_organ(stiffness_volume(case)))
    source = read_source(case, "rest")
    made = making(case, "series", source, ["result.json", "rest.nii.gz", "labels.txt"])
    step = next((s for s in _STEPS_KPA if G.array.max() <= s * _LARGEST), _STEPS_KPA[-1])
    stored = np.rint(np.clip(np.transpose(G.array, (2, 1, 0)) / step, 0, _LARGEST)).astype(np.uint16)
    names = [f"G_{number:03d}.dcm" for number in range(1, len(stored) + 1)]
    with atomic_folder(folder / FOLDER) as temporary:
        for index, name in enumerate(names):
            data = _described(source, made, index)
            place_slice(data, G, index)
            across, down = np.reshape(np.array(data.ImageOrientationPatient, dtype=np.float64), (2, 3))
            data.PatientOrientation = [_towards(across), _towards(down)]
            _add_pixels(data, stored[index], step, float(G.array.max()))
            data.save_as(temporary / name, enforce_file_format=True)
    return [folder / FOLDER / name for name in names]


def _described(source: SourceScan, made: Making, index: int) -> FileDataset:
    """One slice without place and pixels: whose it is, what it is, where it comes from."""
    uid = generate_uid(entropy_srcs=[made.sop_uid, str(index)])
    data = begun(SecondaryCaptureImageStorage, uid, source, made)
    data.InstanceNumber = index + 1
    data.SeriesDescription = made.series_description("stiffness G, kPa")
    data.FrameOfReferenceUID = generate_uid(entropy_srcs=[made.series_uid, "frame of reference"])
    data.PositionReferenceIndicator = ""
    data.Modality, data.ConversionType, data.BodyPartExamined = "OT", "WSD", source.body_part
    data.ImageType = ["DERIVED", "SECONDARY", "AXIAL", "STIFFNESS"]
    data.DerivationDescription = _WARNING
    data.SourceImageSequence = [reference_to(image) for image in source.images]
    data.ImageComments = f"{_WARNING}. {made.note}"
    data.ContentDate, data.ContentTime = made.made.strftime("%Y%m%d"), made.made.strftime("%H%M%S")
    data.BurnedInAnnotation = "NO"
    made.stamp(data)
    return data


def _towards(direction: FloatArray) -> str:
    """The letters of PatientOrientation for a direction (3,) LPS, the nearest axis first."""
    sides = [("L", "R"), ("P", "A"), ("H", "F")]
    order = [axis for axis in np.argsort(-np.abs(direction)) if abs(direction[axis]) > _ALONG]
    return "".join(sides[axis][int(direction[axis] < 0.0)] for axis in order)


def _add_pixels(data: FileDataset, pixels: NDArray[np.uint16], step: float, largest: float) -> None:
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.Rows, data.Columns = pixels.shape
    data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 16, 15, 0
    data.RescaleIntercept, data.RescaleSlope, data.RescaleType = "0", f"{step:g}", "US"
    data.WindowCenter, data.WindowWidth = f"{0.5 * largest:.6g}", f"{largest:.6g}"
    data.RealWorldValueMappingSequence = [
        hd.pm.RealWorldValueMapping(
            lut_label="G_kPa",
            lut_explanation="Shear modulus G, kPa; research use only; 0: none identified",
            unit=KILOPASCAL,
            value_range=(0, _LARGEST),
            slope=step,
            intercept=0.0,
            quantity_definition=SHEAR_MODULUS,
        )
    ]
    data.PixelData = pixels.tobytes()
