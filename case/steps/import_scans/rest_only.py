"""Import of the scan at rest alone into a case folder, for `plan`."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np

from palpate.case.case_folder import CaseFolder, check_new_case, file_sha256
from palpate.case.step_records import ImportRecord
from palpate.case.steps.declarations import IMPORT
from palpate.case.steps.import_scans.options import ImportOptions, check_file, content_of, described_by, scan_sha256
from palpate.case.steps.import_scans.write import gravity_of, open_or_create, write_scan, write_user_labels
from palpate.core.errors import InputError
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.contours.user_labels import read_label_volume, read_user_labels
from palpate.imaging.scans.scan import is_ct, read_scan


def import_alone(
    rest: Path | str, case_path: Path | str, options: ImportOptions | None = None, progress: Progress = silent
) -> ImportRecord:
    """Make the case folder of one scan: a CT (DICOM folder or volume file), or a label volume.

    Returns the content of import.json: case, sources_sha256, residual_mm (None), notes. A later import of the pair into
    the same folder goes on from it. All inputs are read before anything is written. Raises InputError (file, what,
    remedy).
    """
    options, rest, folder = options or ImportOptions(), Path(rest), Path(case_path)
    check_new_case(folder, [rest])
    if not rest.exists():
        raise InputError(
            f"{rest} is not there; give a folder with a DICOM CT series, or a CT or a label volume as a file"
        )
    sources = {"rest": scan_sha256(rest)}
    inputs = _inputs(sources, options, rest)
    earlier = _earlier(folder, sources, inputs)
    if earlier is not None:
        progress(1.0, "already imported")
        return earlier
    progress(0.1, "reading the scan at rest")
    case, notes, outputs = (_from_ct if is_ct(rest) else _from_labels)(rest, folder, options)
    summary: ImportRecord = {"case": str(case.path), "sources_sha256": sources, "residual_mm": None, "notes": notes}
    case.write_json("import.json", summary)
    case.mark_done(IMPORT.name, inputs, [*outputs, "import.json"])
    progress(1.0, "imported")
    return summary


def _from_ct(path: Path, folder: Path, options: ImportOptions) -> tuple[CaseFolder, list[str], list[str]]:
    volume, facts = read_scan(path, options.series[0])
    file = options.labels[0]
    contours = {} if file is None else {"rest": read_user_labels(file, volume, facts, options.roi)}
    case = open_or_create(folder, options.name, [gravity_of(facts.patient_position), None])
    outputs = ["case.json", *write_scan(case, "rest", volume, facts), *write_user_labels(case, contours, np.eye(4))]
    notes = [*facts.notes, *(note for labels in contours.values() for note in labels.notes)]
    return case, [f"rest: {note}" for note in notes], outputs


def _from_labels(path: Path, folder: Path, options: ImportOptions) -> tuple[CaseFolder, list[str], list[str]]:
    labels = read_label_volume(path, options.roi)
    case = open_or_create(folder, options.name, [None, None])
    case.write_labels("rest", labels.volume)
    return case, [f"rest: {note}" for note in labels.notes], ["case.json", "rest.nii.gz", "labels.txt"]


def _inputs(sources: dict[str, str], options: ImportOptions, rest: Path) -> str:
    file = options.labels[0]
    check_file(file, " of the labels")
    beside = [file_sha256(each) for each in described_by(rest)]
    content = [sources, content_of(file), *beside, options.series[0], {k: list(v) for k, v in options.roi.items()}]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _earlier(folder: Path, sources: dict[str, str], inputs: str) -> ImportRecord | None:
    """Summary of a finished import of the same scan; None where there is none. Raises InputError where the case is
    another's.
    """
    if not (folder / "case.json").exists():
        return None
    case = CaseFolder(folder)
    summary: ImportRecord = case.read_json("import.json") if case.has("import.json") else {}
    if summary.get("sources_sha256") != sources:
        raise InputError(f"{folder} is the case of other scans; choose a new folder for the case with -o")
    return summary if case.step_is_done(IMPORT.name, inputs) else None
