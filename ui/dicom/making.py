"""What every exported object says of itself: who made it, when, from what, and that it is for research."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, date, datetime, time
from pathlib import Path
from typing import TypedDict

from pydicom import Dataset
from pydicom.dataset import FileDataset, FileMetaDataset
from pydicom.uid import UID, ExplicitVRLittleEndian, generate_uid
from pydicom.valuerep import DA, DT, TM

from palpate import __version__
from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.core.files.atomic import atomic_path
from palpate.ui.dicom.source import SourceScan
from palpate.ui.report.record import simulated

_OFFSET = re.compile(r"[+-](0[0-9]|1[0-4])[0-5][0-9]")
MANUFACTURER, MODEL = "Palpate", "palpate"
# A LO may have 64 characters.
MARK = "RESEARCH USE ONLY"
NOT_FOR_DIAGNOSIS = "Research use only, not for diagnosis."
CHARACTER_SET = "ISO_IR 192"  # UTF-8: a patient's name is written as the scan has it
SERIES_NUMBERS = {
    "seg": 9101,
    "pm": 9102,
    "sr": 9103,
    "pdf": 9104,
    "deformed seg": 9105,
    "rtstruct": 9106,
    "deformed rtstruct": 9107,
    "series": 9108,
    "pm low": 9109,
    "pm high": 9110,
    "reg": 9111,
}


class Equipment(TypedDict):
    """The arguments by which highdicom's classes say who made an object, in which series, when."""

    series_instance_uid: str
    sop_instance_uid: str
    series_number: int
    instance_number: int
    manufacturer: str
    manufacturer_model_name: str
    software_versions: str
    device_serial_number: str
    content_date: date
    content_time: time
    specific_character_set: str


@dataclass(frozen=True)
class Making:
    """The identity of one exported object. The same case gives the same, so that exporting twice is no second object.

    series_uid, sop_uid : new UIDs. series_number : of the object's own series. made : when the content was made, in the
    scan's time zone where it states one, else in local time. timezone : what the scan states, as every time in an object counts by it.
    note : research use, and what of the pair was computed.
    """

    series_uid: str
    sop_uid: str
    series_number: int
    made: datetime
    note: str
    timezone: str = ""

    def series_description(self, what: str) -> str:
        """At most 64 characters, the mark first."""
        return f"{MARK} - {what}"[:64]

    def equipment(self) -> Equipment:
        """The arguments by which highdicom's classes say who made the object."""
        return {
            "series_instance_uid": self.series_uid, "sop_instance_uid": self.sop_uid,
            "series_number": self.series_number, "instance_number": 1, "manufacturer": MANUFACTURER,
            "manufacturer_model_name": MODEL, "software_versions": version(), "device_serial_number": version(),
            "content_date": self.made.date(), "content_time": self.made.time(),
            "specific_character_set": CHARACTER_SET,
        }  # fmt: skip

    def stamp(self, dataset: Dataset) -> None:
        """Replaces the moment of writing and the random numbers that libraries put there by what follows from the content."""
        organization = generate_uid(entropy_srcs=[self.sop_uid, "dimensions"])
        for item in dataset.get("ContributingEquipmentSequence") or []:
            if "ContributionDateTime" in item:
                item.ContributionDateTime = DT(self.made)
        for keyword in ("DimensionOrganizationSequence", "DimensionIndexSequence"):
            for item in dataset.get(keyword) or []:
                item.DimensionOrganizationUID = organization
        dataset.InstanceCreationDate, dataset.InstanceCreationTime = DA(self.made.date()), TM(self.made.time())
        if self.timezone:
            dataset.TimezoneOffsetFromUTC = self.timezone


def making(case: CaseFolder, kind: str, source: SourceScan, inputs: list[str]) -> Making:
    """The identity of an object of one kind (a key of SERIES_NUMBERS) made from files of the case."""
    present = [case.file(name) for name in inputs if case.has(name)]
    stated = str(source.header.get("TimezoneOffsetFromUTC") or "").strip()
    timezone = stated if _OFFSET.fullmatch(stated) else ""
    made = _clock(max(int(path.stat().st_mtime) for path in present), timezone)
    entropy = [kind, str(source.header.SeriesInstanceUID), made.isoformat(), version()]
    entropy += [file_sha256(path) for path in present]
    computed = simulated(case, None)
    note = NOT_FOR_DIAGNOSIS + (f" Simulated data: {computed}." if computed else "")
    return Making(
        generate_uid(entropy_srcs=[*entropy, "series"]), generate_uid(entropy_srcs=[*entropy, "object"]),
        SERIES_NUMBERS[kind], made, note, timezone,
    )  # fmt: skip


def _clock(seconds: int, offset: str) -> datetime:
    """The time of an instant, without its zone: at an offset as DICOM writes it (+0130), or local."""
    moment = datetime.fromtimestamp(seconds, UTC)
    zone = datetime.strptime(offset, "%z").tzinfo if offset else None
    return moment.astimezone(zone).replace(tzinfo=None)


def version() -> str:
    """Of this program."""
    return __version__


def save(dataset: Dataset, path: Path) -> Path:
    """Writes an object; all or nothing."""
    with atomic_path(path) as temporary:
        dataset.save_as(temporary, enforce_file_format=True)
    return path


def begun(storage: UID, sop_uid: str, source: SourceScan, made: Making) -> FileDataset:
    """An object of a storage class with nothing in it yet but whose it is, of which series, and who made it."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = storage, UID(sop_uid)
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data = FileDataset("", {}, file_meta=meta, preamble=b"\0" * 128)
    data.SpecificCharacterSet = CHARACTER_SET
    data.SOPClassUID, data.SOPInstanceUID = storage, UID(sop_uid)
    source.copy_identity(data)
    data.SeriesInstanceUID, data.SeriesNumber = made.series_uid, made.series_number
    data.Manufacturer, data.ManufacturerModelName, data.SoftwareVersions = MANUFACTURER, MODEL, version()
    return data
