"""The whole way from two scans to a case with its stiffness, diagnosis and report."""

from __future__ import annotations

from pathlib import Path

from palpate.case.case_folder import CaseFolder
from palpate.case.steps import diagnose, identify, mesh
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.case.steps.import_scans.pair import run_import
from palpate.case.steps.segment import run_segment
from palpate.core.errors import InputError
from palpate.core.worker.progress import Progress, part, silent
from palpate.ui.python.checks import path_of, search_options, truth
from palpate.ui.python.from_case import Case
from palpate.ui.report import report_step

Paths = tuple[str | Path | None, str | Path | None]


def analyze(
    rest: str | Path,
    deformed: str | Path,
    case: str | Path,
    *,
    labels: Paths = (None, None),
    landmarks: str | Path | None = None,
    registration: str | Path | None = None,
    diagnosis: bool = True,
    report: bool = True,
    progress: Progress = silent,
    **options: object,
) -> Case:
    """The case of two scans, as `palpate analyze` makes it: imported, segmented, meshed, identified, diagnosed, reported.

    rest, deformed : CTs (DICOM folders, NIfTI, NRRD, MetaImage), or label volumes in such files. case : folder to make; a second
    call on the same input passes over what is done. labels : contours of both scans, in any format of `palpate import`. landmarks : CSV of
    matched points. registration : rigid DICOM REG of the two CTs, instead of the alignment on bone. progress : hears a
    fraction and a message. options : fields of `IdentifyOptions`; `seed` is the diagnosis's too.

    The search runs in a process of its own: call it from a script under ``if __name__ == "__main__":``. Raises InputError
    (file, what, remedy) and ConvergenceError when nothing can be solved.
    """
    search = search_options(options, "palpate.analyze")
    if not isinstance(labels, tuple | list) or len(labels) != 2:
        raise InputError(f"labels is {labels!r}; give two paths, of the scan at rest and of the deformed one, or None")
    drawn = tuple(None if given is None else path_of(given, "labels") for given in labels)
    marks = None if landmarks is None else path_of(landmarks, "landmarks")
    matrix = None if registration is None else path_of(registration, "registration")
    scans, made = (path_of(rest, "rest"), path_of(deformed, "deformed")), path_of(case, "case")
    for name, value in (("diagnosis", diagnosis), ("report", report)):
        truth(value, name)
    if not callable(progress):
        raise InputError(f"progress is {progress!r}; give a function of a fraction and a message")
    given = ImportOptions(labels=(drawn[0], drawn[1]), landmarks=marks, registration=matrix)
    run_import(*scans, made, given, part(progress, 0.0, 0.1))
    folder = CaseFolder(made)
    run_segment(folder, None, part(progress, 0.1, 0.3), search.workers)
    mesh.run(folder, progress=part(progress, 0.3, 0.35))
    identify.run(folder, search, part(progress, 0.35, 0.8))
    if diagnosis:
        diagnose.run(
            folder,
            diagnose.DiagnoseOptions(seed=search.seed, image=search.image, law=search.law),
            part(progress, 0.8, 0.95),
        )
    if report:
        report_step.run(folder, None, part(progress, 0.95, 1.0))
    return Case(folder)
