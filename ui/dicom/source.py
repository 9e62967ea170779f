"""The scan that an exported object refers to."""

from __future__ import annotations

import logging
import warnings
from dataclasses import dataclass

import highdicom as hd
import numpy as np
from pydicom import Dataset
from pydicom.valuerep import validate_value

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.imaging.dicom.files import find_dicom, reading
from palpate.imaging.dicom.slices import is_image, is_localizer
from palpate.imaging.scans.scan import is_kept_volume
from palpate.imaging.volume import Volume

# highdicom quotes names that it finds odd, and they are the patient's: nothing of it reaches any log or terminal.
warnings.filterwarnings("ignore", module="highdicom")
logging.getLogger("highdicom").setLevel(logging.CRITICAL)

# Attributes that every object of a patient and study must have, though they may be blank, and how they are written.
_MAY_BE_BLANK = {
    "PatientID": "LO", "PatientName": "PN", "PatientBirthDate": "DA", "PatientSex": "CS", "StudyID": "SH",
    "AccessionNumber": "SH", "StudyDate": "DA", "StudyTime": "TM", "ReferringPhysicianName": "PN",
}  # fmt: skip
_IDENTITY = (*_MAY_BE_BLANK, "StudyInstanceUID", "PatientIdentityRemoved", "DeidentificationMethod")
_SEXES = ("M", "F", "O", "")


@dataclass(frozen=True, eq=False)
class SourceScan:
    """images : headers without pixels of the CT files of one state; patient and study in them are the object's too.

    They may hold the patient's identity: they go into DICOM objects only, never into a message or a file's name.
    """

    images: list[Dataset]

    @property
    def header(self) -> Dataset:
        """The first image."""
        return self.images[0]

    @property
    def body_part(self) -> str:
        """BodyPartExamined, without which an image must state its laterality."""
        return str(self.header.get("BodyPartExamined") or "PELVIS")

    def copy_identity(self, dataset: Dataset) -> None:
        """Puts patient and study of this scan into a new object: it is of the same patient."""
        for keyword in _IDENTITY:
            if keyword in self.header:
                setattr(dataset, keyword, self.header.get(keyword))

    def placed(self, volume: Volume) -> hd.Volume:
        """A volume in this scan's frame of reference as highdicom has it: frames along k, rows along j, columns along i."""
        return hd.Volume(
            np.ascontiguousarray(np.transpose(volume.array)),
            volume.affine[:, [2, 1, 0, 3]],
            coordinate_system="PATIENT",
            frame_of_reference_uid=self.header.FrameOfReferenceUID,
        )


def read_source(case: CaseFolder, state: str) -> SourceScan:
    """The headers of the CT of a state. Raises InputError when the case has no CT or it cannot be referred to."""
    folder = case.file(f"{state}_ct")
    if not folder.is_dir():
        raise InputError(f"{folder} is not there; a DICOM object needs the CT it belongs to: import the scans as DICOM")
    if is_kept_volume(folder):
        raise InputError(
            f"{folder}: the {state} scan was no DICOM, so nothing can refer to it; import the scans as DICOM"
        )
    files = [f for f in find_dicom(folder, []) if is_image(f.header) and not is_localizer(f.header)]
    if not files:
        raise InputError(f"{folder} holds no CT image; import the scans as DICOM")
    for file in files:
        with reading(file.path):
            _fill(file.header)
        missing = [
            k for k in ("StudyInstanceUID", "SeriesInstanceUID", "FrameOfReferenceUID") if not file.header.get(k)
        ]
        if missing:
            raise InputError(f"{file.path} lacks {missing[0]}, so nothing can refer to it; export the scan again")
    if len(files) > 1 and any("NumberOfFrames" in f.header and f.header.NumberOfFrames > 1 for f in files):
        raise InputError(f"{folder} holds a scan in several multi-frame files; export it as single slices")
    return SourceScan([file.header for file in files])


def reference_to(image: Dataset) -> Dataset:
    """The item by which a sequence refers to an image."""
    item = Dataset()
    item.ReferencedSOPClassUID, item.ReferencedSOPInstanceUID = image.SOPClassUID, image.SOPInstanceUID
    return item


def set_thickness(found: Dataset, volume: Volume) -> None:
    """States the slice thickness of a SEG or map from the volume that it holds: highdicom takes the scan's, if it has one."""
    measures = found.SharedFunctionalGroupsSequence[0].PixelMeasuresSequence[0]
    measures.SliceThickness = measures.SpacingBetweenSlices = f"{volume.spacing[2]:.6g}"


def _fill(header: Dataset) -> None:
    """Blanks what must be there but may be blank, where it is absent or not in its form."""
    for keyword, vr in _MAY_BE_BLANK.items():
        value = header.get(keyword)
        if value is None or not _is_well_formed(vr, str(value)):
            setattr(header, keyword, "")
    if str(header.PatientSex) not in _SEXES:
        header.PatientSex = "O"
    if "NumberOfFrames" not in header and not header.get("SliceThickness"):
        # highdicom asks for it; ``set_thickness`` puts the right one into the objects.
        header.SliceThickness = "1"


def _is_well_formed(vr: str, text: str) -> bool:
    try:
        validate_value(vr, text, 2)  # pydicom's mode 2 raises
    except ValueError:
        return False
    return True
