"""Import of two scans, or of two label volumes, into a case folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.case.aligned_labels import in_own_frame
from palpate.case.case_facts import Vector
from palpate.case.case_folder import STATES, CaseFolder, check_new_case
from palpate.case.landmarks import read_landmarks
from palpate.case.step_records import ImportRecord
from palpate.case.steps.declarations import IMPORT
from palpate.case.steps.import_scans.options import (
    ImportOptions,
    are_cts,
    inputs_sha256,
    scan_sha256,
)
from palpate.case.steps.import_scans.write import (
    gravity_of,
    open_or_create,
    write_alignment,
    write_landmarks,
    write_scan,
    write_user_labels,
)
from palpate.case.swapped_contours import swapped_note
from palpate.core.errors import InputError
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.contours.label_reader import UserLabels
from palpate.imaging.contours.user_labels import lying_in, read_label_volume, read_user_labels
from palpate.imaging.dicom.pair_check import check_pair
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.labels import BONE, ORGAN_LABELS
from palpate.imaging.registration.align_on_bone import Alignment, align_ct, align_labels, given_alignment
from palpate.imaging.registration.dicom_registration import read_registration, unused_registrations
from palpate.imaging.scans.scan import read_scan
from palpate.imaging.volume import Volume

Scan = tuple[Volume, SeriesFacts]


@dataclass(frozen=True)
class _Job:
    paths: tuple[Path, Path]
    folder: Path
    options: ImportOptions
    progress: Progress
    sources: dict[str, str]
    inputs: str


def run_import(
    rest: Path | str,
    deformed: Path | str,
    case_path: Path | str,
    options: ImportOptions | None = None,
    progress: Progress = silent,
) -> ImportRecord:
    """Make the case folder of a pair: two CTs (DICOM folders or volume files), or two label volumes.

    Returns the content of import.json: case, sources_sha256, residual_mm, notes. All inputs are read and checked before
    anything is written. A rerun with the same inputs does nothing. Raises InputError (file, what, remedy).
    """
    options = options or ImportOptions()
    paths, folder = (Path(rest), Path(deformed)), Path(case_path)
    check_new_case(folder, paths)
    scanned = are_cts(paths)
    sources = {state: scan_sha256(path) for state, path in zip(STATES, paths, strict=True)}
    if options.registration is not None and not (scanned and options.align):
        raise InputError(
            f"{options.registration} aligns two CTs; leave it out for label volumes and for scans in one frame already"
        )
    job = _Job(paths, folder, options, progress, sources, inputs_sha256(sources, options, paths))
    earlier = _earlier(job)
    if earlier is not None:
        progress(1.0, "already imported")
        return earlier
    return _import_scans(job) if scanned else _import_labels(job)


def _import_scans(job: _Job) -> ImportRecord:
    options, scans = job.options, []
    for index, state in enumerate(STATES):
        job.progress(0.2 * index, f"reading the {state} scan")
        scans.append(read_scan(job.paths[index], options.series[index]))
    facts = scans[0][1], scans[1][1]
    notes = [f"{state}: {note}" for state, one in zip(STATES, facts, strict=True) for note in one.notes]
    notes += check_pair(scans[0], scans[1], options.same_patient)
    points = read_landmarks(options.landmarks) if options.landmarks else None
    job.progress(0.4, "aligning")
    alignment = _alignment(job, scans)
    if options.registration is None:
        notes += unused_registrations(*facts, job.paths)
    contours = _drawn(job, scans, alignment)
    notes += [f"{state}: {note}" for state, labels in contours.items() for note in labels.notes]
    notes += [
        f"{state}: the drawn labels hold no prostate; it will be looked for in the CT"
        for state, labels in contours.items()
        if not np.isin(labels.volume.array, ORGAN_LABELS).any()
    ]
    job.progress(0.8, "writing the case")
    case = _begun(job, [gravity_of(one.patient_position) for one in facts])
    outputs = ["case.json", "alignment.json"]
    for state, scan in zip(STATES, scans, strict=True):
        outputs += write_scan(case, state, *scan)
    matrix = write_alignment(case, alignment)
    swapped = swapped_note(
        {state: scan[0] for state, scan in zip(STATES, scans, strict=True)},
        {state: labels.volume for state, labels in contours.items()},
        matrix,
    )
    notes += [swapped] if swapped else []
    outputs += write_user_labels(case, contours, matrix) + write_landmarks(case, points, matrix)
    return _finish(job, case, alignment, notes, outputs)


def _alignment(job: _Job, scans: Sequence[Scan]) -> Alignment | None:
    """The alignment of two CTs, by the registration that was given, else on bone; None where none is wanted."""
    options, (rest, deformed) = job.options, scans
    if not options.align:
        return None
    if options.registration is None:
        return _aligned(job, align_ct, rest[0], deformed[0], [rest[1], deformed[1]])
    matrix = read_registration(options.registration, rest[1], deformed[1])
    return given_alignment(rest[0], deformed[0], matrix, options.registration)


def _drawn(job: _Job, scans: Sequence[Scan], alignment: Alignment | None) -> dict[str, UserLabels]:
    """The contours of each scan that has any, in its own frame."""
    options = job.options
    contours = {
        state: read_user_labels(path, *scan, options.roi_of(state), placed=state == "rest" or alignment is None)
        for state, path, scan in zip(STATES, options.labels, scans, strict=True)
        if path is not None
    }
    if alignment is not None and "deformed" in contours:
        own = in_own_frame(contours["deformed"], scans[1][0], alignment.deformed_to_rest)
        contours["deformed"] = lying_in(own, scans[1][0], Path(options.labels[1] or ""))
    return contours


def _import_labels(job: _Job) -> ImportRecord:
    job.progress(0.1, "reading the label volumes")
    both = [read_label_volume(path, job.options.roi_of(state)) for state, path in zip(STATES, job.paths, strict=True)]
    volumes = [labels.volume for labels in both]
    if np.array_equal(volumes[0].array, volumes[1].array) and np.allclose(volumes[0].affine, volumes[1].affine):
        raise InputError(
            f"{job.paths[0]} and {job.paths[1]} hold the same labels; give one of the organ at rest and one deformed"
        )
    points = read_landmarks(job.options.landmarks) if job.options.landmarks else None
    notes = [f"{state}: {note}" for state, labels in zip(STATES, both, strict=True) for note in labels.notes]
    alignment = None
    if job.options.align and all((volume.array == BONE).any() for volume in volumes):
        job.progress(0.3, "aligning on bone")
        alignment = _aligned(job, align_labels, volumes[0], volumes[1])
    else:
        notes.append("the label volumes were taken as aligned on bone already")
    job.progress(0.8, "writing the case")
    case = _begun(job, [None, None])
    matrix = write_alignment(case, alignment)
    case.write_labels("rest", volumes[0])
    case.write_labels("deformed", volumes[1].moved(matrix))
    outputs = ["case.json", "rest.nii.gz", "deformed.nii.gz", "labels.txt", "alignment.json"]
    return _finish(job, case, alignment, notes, outputs + write_landmarks(case, points, matrix))


def _aligned(
    job: _Job,
    align: Callable[[Volume, Volume], Alignment],
    rest: Volume,
    deformed: Volume,
    facts: Sequence[SeriesFacts] = (),
) -> Alignment:
    try:
        return align(rest, deformed)
    except InputError as error:
        where, why = f"{job.paths[0]} and {job.paths[1]}", str(error)
        dates = [one.study_date for one in facts]
        if len(facts) == 2 and facts[0].patient_hash == facts[1].patient_hash is not None and None not in dates:
            raise InputError(
                f"{where} are scans of one patient, of {' and '.join(map(str, dates))}, but share no pelvis ({why.partition(';')[0]}); "
                "give two scans that both show it"
            ) from error
        raise InputError(f"{where}: {why}") from error


def _begun(job: _Job, gravity: Sequence[Vector | None]) -> CaseFolder:
    """The case folder, marked as made by this import before anything else is written, so that a rerun may go on."""
    case = open_or_create(job.folder, job.options.name, gravity)
    case.write_json("import.json", {"case": str(case.path), "sources_sha256": job.sources})
    return case


def _finish(
    job: _Job, case: CaseFolder, alignment: Alignment | None, notes: list[str], outputs: list[str]
) -> ImportRecord:
    summary: ImportRecord = {
        "case": str(case.path),
        "sources_sha256": job.sources,
        "residual_mm": None if alignment is None else round(alignment.residual_mm, 3),
        "notes": notes + list(alignment.notes if alignment else ()),
    }
    if job.options.registration is not None:
        summary["aligned_by"] = "registration"
    case.write_json("import.json", summary)
    case.mark_done(IMPORT.name, job.inputs, [*outputs, "import.json"])
    job.progress(1.0, "imported")
    return summary


def _earlier(job: _Job) -> ImportRecord | None:
    """Summary of a finished import of the same inputs; None where there is none. Raises InputError where the case is
    another's.
    """
    if not (job.folder / "case.json").exists():
        return None
    case = CaseFolder(job.folder)
    if not case.has("import.json"):
        if any(case.has(f"{state}{kind}") for state in STATES for kind in ("_ct", ".nii.gz")):
            raise InputError(f"{job.folder} is a case that was not imported; choose a new folder for the case with -o")
        return None
    summary: ImportRecord = case.read_json("import.json")
    sources = summary.get("sources_sha256", {})
    if sources == {"rest": job.sources["rest"]}:  # imported alone before; the second scan is new
        return None
    if sources != job.sources:
        raise InputError(f"{job.folder} is the case of other scans; choose a new folder for the case with -o")
    if case.step_is_done(IMPORT.name, job.inputs):
        return summary
    # A rerun without an option must not delete the contours that a result was made from.
    forgotten = [
        state
        for state, path in zip(STATES, job.options.labels, strict=True)
        if path is None and case.has(f"{state}_user.nii.gz")
    ]
    if forgotten:
        options = " and ".join(f"--{state}-labels" for state in forgotten)
        raise InputError(f"{job.folder} was made with {options}; give the same again, or choose a new folder with -o")
    return None
