"""What an import is given: its options, of what kind the two inputs are, and their hashes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from palpate.case.case_files import file_sha256
from palpate.core.errors import InputError
from palpate.imaging.contours.user_labels import files_of
from palpate.imaging.dicom.files import list_files

_NIFTI = (".nii", ".nii.gz")


@dataclass(frozen=True)
class ImportOptions:
    """How to import. Each pair is (rest, deformed).

    name : the case's name; the folder's where None. series : which series of a folder that holds several.
    labels : label volume (NIfTI) or structure set (RTSTRUCT) drawn on that scan. roi : organ -> structure names.
    landmarks : CSV of matched points, each in its own scan's coordinates. same_patient : the caller vouches for it.
    align : False takes both states as lying in one frame already.
    """

    name: str | None = None
    series: tuple[str | None, str | None] = (None, None)
    labels: tuple[Path | None, Path | None] = (None, None)
    roi: Mapping[str, Sequence[str]] = field(default_factory=dict)
    landmarks: Path | None = None
    same_patient: bool = False
    align: bool = True


def check_kinds(paths: tuple[Path, Path]) -> None:
    """Raises InputError unless these are two folders or two NIfTI files."""
    for path in paths:
        if not path.exists():
            raise InputError(f"{path} is not there; give a folder with a DICOM CT series or a NIfTI label volume")
        if path.is_file() and not path.name.lower().endswith(_NIFTI):
            raise InputError(f"{path} is no folder and no NIfTI file; give the folder that holds the slices of the CT")
    if paths[0].is_dir() != paths[1].is_dir():
        raise InputError(
            f"{paths[0]} and {paths[1]} are a folder and a file; give two DICOM folders or two NIfTI files"
        )


def scan_sha256(path: Path) -> str:
    """Of a file, or of all files of a folder."""
    if path.is_file():
        return file_sha256(path)
    return hashlib.sha256("".join(file_sha256(file) for file in list_files(path)).encode()).hexdigest()


def inputs_sha256(sources: Mapping[str, str], options: ImportOptions, scans: Sequence[Path] = ()) -> str:
    """One hash of all that an import stands on. sources : `scan_sha256` by state. scans : the paths of the scans or label volumes.

    Raises InputError for files that are not there.
    """
    given = [path for path in (*options.labels, options.landmarks) if path is not None]
    missing = [path for path in given if not path.is_file()]
    if missing:
        raise InputError(f"{missing[0]} is not there; correct the path of the labels or landmarks")
    content = {
        "sources": dict(sources),
        "files": [[content_of(path) for path in (*options.labels, options.landmarks)]],
        **{f"beside {path.name}": file_sha256(file) for path in scans for file in described_by(path)},
        "options": [options.series, {k: list(v) for k, v in options.roi.items()}, options.align, options.same_patient],
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def content_of(path: Path | None) -> str | None:
    """The hash of a file and of what is read with it: a workspace's label volume, the label names beside a volume."""
    if path is None:
        return None
    files = files_of(path)
    missing = [each for each in files if not each.is_file()]
    if missing:
        raise InputError(f"{path} names {missing[0].name}, which is not there; keep the workspace with its images")
    return file_sha256(path) if len(files) == 1 else "".join(file_sha256(each) for each in files)


def described_by(path: Path) -> list[Path]:
    """What is read with a label volume that is imported instead of a scan: the names of its values."""
    return [file for file in files_of(path) if file != path] if path.is_file() else []
