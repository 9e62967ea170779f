"""Input of an import: options, kind of the two scans, and hashes."""

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

    name : of the case; None for that of the folder. series : identifier of the series in a folder that holds several.
    labels : contours of that scan, in any format of `imaging.contours`. roi : organ -> structure names, in both files;
    rois : the same for each file by itself, which goes before. landmarks : CSV
    of matched points, each in its own scan's coordinates. same_patient : skips the comparison of patients. align :
    False where both states are in one frame already.
    """

    name: str | None = None
    series: tuple[str | None, str | None] = (None, None)
    labels: tuple[Path | None, Path | None] = (None, None)
    roi: Mapping[str, Sequence[str]] = field(default_factory=dict)
    landmarks: Path | None = None
    same_patient: bool = False
    align: bool = True
    rois: tuple[Mapping[str, Sequence[str]], Mapping[str, Sequence[str]]] = field(default_factory=lambda: ({}, {}))

    def roi_of(self, state: str) -> Mapping[str, Sequence[str]]:
        """Organ -> structure names in the file of a state."""
        return self.rois[0 if state == "rest" else 1] or self.roi


def check_kinds(paths: tuple[Path, Path]) -> None:
    """Check of the two inputs. Raises InputError unless they are two folders or two NIfTI files."""
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
    """Hash of a file, or of all files of a folder."""
    if path.is_file():
        return file_sha256(path)
    return hashlib.sha256("".join(file_sha256(file) for file in list_files(path)).encode()).hexdigest()


def check_file(path: Path | None, whose: str = "") -> None:
    """Raises InputError where a path that is given is no file."""
    if path is not None and not path.is_file():
        wrong = "is a folder; give the file" if path.is_dir() else "is not there; correct the path"
        raise InputError(f"{path} {wrong}{whose}")


def inputs_sha256(sources: Mapping[str, str], options: ImportOptions, scans: Sequence[Path] = ()) -> str:
    """Hash of all inputs of an import. sources : `scan_sha256` by state. scans : paths of the scans or label volumes.

    Raises InputError for files that do not exist.
    """
    for path in (*options.labels, options.landmarks):
        check_file(path, " of the labels or landmarks")
    content = {
        "sources": dict(sources),
        "files": [[content_of(path) for path in (*options.labels, options.landmarks)]],
        **{f"beside {path.name}": file_sha256(file) for path in scans for file in described_by(path)},
        "options": [options.series, {k: list(v) for k, v in options.roi.items()}, options.align, options.same_patient],
    }
    if any(options.rois):
        content["rois"] = [{k: list(v) for k, v in roi.items()} for roi in options.rois]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def content_of(path: Path | None) -> str | None:
    """Hash of a file and of the files that are read with it: a workspace's label volume, the label names beside a
    volume.
    """
    if path is None:
        return None
    files = files_of(path)
    missing = [each for each in files if not each.is_file()]
    if missing:
        raise InputError(f"{path} names {missing[0].name}, which is not there; keep the workspace with its images")
    return file_sha256(path) if len(files) == 1 else "".join(file_sha256(each) for each in files)


def described_by(path: Path) -> list[Path]:
    """Files that are read with an imported label volume: the names of its values."""
    return [file for file in files_of(path) if file != path] if path.is_file() else []
