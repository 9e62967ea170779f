"""The whole way from two scans to a case with its stiffness, diagnosis and report."""

from __future__ import annotations

from pathlib import Path

from palpate.case.case_folder import CaseFolder
from palpate.case.steps import diagnose, identify, mesh
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.case.steps.import_scans.pair import run_import
from palpate.case.steps.segment import run_segment
from palpate.core.identify.options import IdentifyOptions
from palpate.core.worker.progress import Progress, part, silent
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
    diagnosis: bool = True,
    report: bool = True,
    progress: Progress = silent,
    **options: object,
) -> Case:
    """The case of two scans, as `palpate analyze` makes it: imported, segmented, meshed, identified, diagnosed, reported.

    rest, deformed : CTs (DICOM folders, NIfTI, NRRD, MetaImage), or NIfTI label volumes. case : folder to make; a second call on the same
    input passes over what is done. labels : contours of both scans, in any format of `palpate import`. landmarks : CSV of
    matched points. progress : hears a fraction and a message. options : fields of `IdentifyOptions`; `seed` is the
    diagnosis's too.

    The search runs in a process of its own: call it from a script under ``if __name__ == "__main__":``. Raises InputError
    (file, what, remedy) and ConvergenceError when nothing can be solved.
    """
    search = IdentifyOptions(**options)  # type: ignore[arg-type]
    drawn = tuple(None if path is None else Path(path) for path in labels)
    given = ImportOptions(labels=(drawn[0], drawn[1]), landmarks=None if landmarks is None else Path(landmarks))
    run_import(rest, deformed, case, given, part(progress, 0.0, 0.1))
    folder = CaseFolder(case)
    run_segment(folder, None, part(progress, 0.1, 0.3), search.workers)
    mesh.run(folder, progress=part(progress, 0.3, 0.35))
    identify.run(folder, search, part(progress, 0.35, 0.8))
    if diagnosis:
        diagnose.run(folder, diagnose.DiagnoseOptions(seed=search.seed, image=search.image), part(progress, 0.8, 0.95))
    if report:
        report_step.run(folder, None, part(progress, 0.95, 1.0))
    return Case(folder)
