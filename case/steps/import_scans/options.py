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
from palpate.imaging.scans.scan import files_of_scan, is_ct


@dataclass(frozen=True)
class ImportOptions:
    """How to import. Each pair is (rest, deformed).

    name : of the case; None for that of the folder. series : identifier of the series in a folder that holds several.
    labels : contours of that scan, in any format of `imaging.contours`. roi : organ -> structure names, in both files;
    rois : the same for each file by itself, which goes before. landmarks : CSV
    of matched points, each in its own scan's coordinates. same_patient : skips the comparison of patients. align :
    False where both states are in one frame already. registration : DICOM REG file of the two scans that goes before bone.
    """

    name: str | None = None
    series: tuple[str | None, str | None] = (None, None)
    labels: tuple[Path | None, Path | None] = (None, None)
    roi: Mapping[str, Sequence[str]] = field(default_factory=dict)
    landmarks: Path | None = None
    same_patient: bool = False
    align: bool = True
    registration: Path | None = None
    rois: tuple[Mapping[str, Sequence[str]], Mapping[str, Sequence[str]]] = field(default_factory=lambda: ({}, {}))

    def roi_of(self, state: str) -> Mapping[str, Sequence[str]]:
        """Organ -> structure names in the file of a state."""
        return self.rois[0 if state == "rest" else 1] or self.roi


def are_cts(paths: tuple[Path, Path]) -> bool:
    """Whether two inputs are CTs, not label volumes. Raises InputError where one is not there, neither, or of the other kind."""
    for path in paths:
        if not path.exists():
            raise InputError(f"{path} is not there; give a folder with a DICOM CT series, or a volume file")
    kinds = [is_ct(path) for path in paths]
    if kinds[0] != kinds[1]:
        ct, labels = paths if kinds[0] else paths[::-1]
        raise InputError(f"{ct} is a CT and {labels} holds labels; give two CTs or two label volumes")
    return kinds[0]


def scan_sha256(path: Path) -> str:
    """Hash of a file, or of all files that make one scan."""
    files = files_of_scan(path)
    if files == [path]:
        return file_sha256(path)
    return hashlib.sha256("".join(file_sha256(file) for file in files).encode()).hexdigest()


def check_file(path: Path | None, whose: str = "") -> None:
    """Raises InputError where a path that is given is no file."""
    if path is not None and not path.is_file():
        wrong = "is a folder; give the file" if path.is_dir() else "is not there; correct the path"
        raise InputError(f"{path} {wrong}{whose}")


def inputs_sha256(sources: Mapping[str, str], options: ImportOptions, scans: Sequence[Path] = ()) -> str:
    """Hash of all inputs of an import. sources : `scan_sha256` by state. scans : paths of the scans or label volumes.

    Raises InputError for files that do not exist.
    """
    for path in (*options.labels, options.landmarks, options.registration):
        check_file(path, " of the labels, landmarks or registration")
    content = {
        "sources": dict(sources),
        "files": [[content_of(path) for path in (*options.labels, options.landmarks)]],
        **{f"beside {path.name}": file_sha256(file) for path in scans for file in described_by(path)},
        "options": [options.series, {k: list(v) for k, v in options.roi.items()}, options.align, options.same_patient],
    }
    if options.registration is not None:
        content["registration"] = file_sha256(options.registration)
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
