"""Which DICOM files lie in a folder, and reading one of them without surprises."""

from __future__ import annotations

import logging
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pydicom
from pydicom.errors import BytesLengthException, InvalidDicomError

from palpate.core.errors import InputError

MAX_FILES = 20_000
_DIRECTORY_CLASS = "1.2.840.10008.1.3.10"
_DICOM_SUFFIXES = (".dcm", ".dicom", ".ima")
# What pydicom raises on damaged files, header and elements.
DAMAGE = (
    *(AttributeError, EOFError, KeyError, NotImplementedError, OSError, RuntimeError, TypeError, ValueError),
    *(struct.error, BytesLengthException),
)
# pydicom converts an element when it is asked for: these are asked for at once, where damage can be told with its file.
_TOUCHED = (
    *("SOPClassUID", "SOPInstanceUID", "Modality", "ImageType", "SeriesInstanceUID", "StudyInstanceUID"),
    *(
        "FrameOfReferenceUID",
        "PatientID",
        "PatientName",
        "PatientPosition",
        "StudyDate",
        "SeriesDate",
        "Rows",
        "Columns",
    ),
    *("ImagePositionPatient", "PerFrameFunctionalGroupsSequence", "InstanceNumber"),
)

# pydicom quotes the values it complains of, and these may be names: nothing of it reaches any log or terminal.
logging.getLogger("pydicom").setLevel(logging.CRITICAL)
warnings.filterwarnings("ignore", module="pydicom")
pydicom.config.settings.reading_validation_mode = pydicom.config.IGNORE


@dataclass(frozen=True, eq=False)
class DicomFile:
    """A DICOM file and its header without pixels."""

    path: Path
    header: pydicom.Dataset


@contextmanager
def quiet() -> Iterator[None]:
    """Silences pydicom's warnings on sloppy values; what matters here is checked and said in our own words."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Reading elements of a dataset: silent on sloppy values, InputError naming the file on damaged ones."""
    try:
        with quiet():
            yield
    except DAMAGE as error:
        raise InputError(f"{path} is a damaged DICOM file; copy or export it again") from error


def read_file(path: Path, stop_before_pixels: bool = False) -> pydicom.Dataset | None:
    """The dataset of one file; None when it is not DICOM.

    Files without the preamble that the standard asks for are read where their first element is a DICOM one.
    Raises InputError naming the file when it is DICOM but damaged, or cannot be read.
    """
    with reading(path):
        try:
            dataset = _read(path, stop_before_pixels)
        except InvalidDicomError:
            return None
        except PermissionError as error:
            raise InputError(f"{path} may not be read; ask for permission to it or copy it") from error
        for keyword in _TOUCHED:
            dataset.get(keyword)
        return dataset


def find_dicom(folder: Path, notes: list[str]) -> list[DicomFile]:
    """The DICOM files under ``folder``, sorted by path; DICOMDIR indexes and other files are left out with a note.

    Raises InputError when ``folder`` is no folder, holds no DICOM file, or a file named as DICOM is none.
    """
    found, others = [], []
    for path in list_files(folder):
        header = read_file(path, stop_before_pixels=True)
        with reading(path):
            kind = "" if header is None else _class_of(header)
        if header is None or not kind:
            others.append(path)
        elif kind != _DIRECTORY_CLASS:
            found.append(DicomFile(path, header))
    damaged = [path for path in others if path.suffix.lower() in _DICOM_SUFFIXES]
    if damaged:
        raise InputError(f"{damaged[0]} is not DICOM although its name says so; copy it again or remove it")
    if not found:
        raise InputError(f"{folder} holds no DICOM image; give the folder that holds the slices of one CT series")
    if others:
        notes.append(f"{len(others)} files that are not DICOM were left out, the first is {others[0].name}")
    return found


def list_files(folder: Path) -> list[Path]:
    """The files under a folder, sorted. Raises InputError when there is none, or so many that it is the wrong folder."""
    if not folder.exists():
        raise InputError(f"{folder} is not there; give the folder of a DICOM series")
    if not folder.is_dir():
        raise InputError(f"{folder} is a file; give the folder that holds the slices of one CT series")
    files = []
    for path in folder.rglob("*"):
        if path.is_file() and not path.name.startswith("."):
            files.append(path)
        if len(files) > MAX_FILES:
            raise InputError(f"{folder} holds more than {MAX_FILES} files; give the folder of one series")
    if not files:
        raise InputError(f"{folder} is empty; give the folder that holds the slices of one CT series")
    return sorted(files)


def _read(path: Path, stop_before_pixels: bool) -> pydicom.Dataset:
    try:
        return pydicom.dcmread(path, stop_before_pixels=stop_before_pixels)
    except InvalidDicomError:
        with path.open("rb") as stream:
            start = stream.read(4)
        # (0008,xxxx) or (0002,xxxx), little endian: how old files without a preamble begin.
        if start[:2] not in (b"\x08\x00", b"\x02\x00") or len(start) < 4:
            raise
        return pydicom.dcmread(path, stop_before_pixels=stop_before_pixels, force=True)


def _class_of(header: pydicom.Dataset) -> str:
    meta = getattr(header, "file_meta", None) or pydicom.Dataset()
    return str(header.get("SOPClassUID") or meta.get("MediaStorageSOPClassUID") or "")
