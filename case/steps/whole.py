"""Makes the files of a slimmed case whole, from its scans and labels, before something is computed from them."""

from __future__ import annotations

from palpate.case.case_folder import CaseFolder
from palpate.case.matched import FILE as MATCHED
from palpate.case.slimmed import slim_files
from palpate.case.steps import match, mesh
from palpate.core.worker.progress import Progress, part, silent


def make_whole(case: CaseFolder, progress: Progress = silent) -> None:
    """Surfaces, then the matched motion, where they are not whole; most cases are left as they are.

    Raises InputError as the steps do.
    """
    missing = slim_files(case)
    if mesh.SURFACES_FILE in missing:
        mesh.run(case, progress=part(progress, 0.0, 0.5))
    if MATCHED in missing:
        case.remove(MATCHED)
        match.run(case, progress=part(progress, 0.5, 1.0))
