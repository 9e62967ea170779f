"""A job that writes a case in one form for other programs, in the window's worker."""

from __future__ import annotations

from pathlib import Path

import msgspec

from palpate.case.case_folder import CaseFolder
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter
from palpate.ui.export import export

KIND = "palpate.ui.desktop.session.export_job:run"


class _Export(msgspec.Struct, frozen=True):
    """Options. case : its folder. form : one of `export.names`. folder : where the files go."""

    case: str
    form: str
    folder: str


def export_job(case: Path, form: str, folder: Path, scratch: Path) -> Job:
    """The job. scratch : for its messages and log."""
    return Job(KIND, str(scratch), options={"case": str(case), "form": form, "folder": str(folder)})


def run(job: Job, reporter: Reporter) -> dict[str, object]:
    """Options as `_Export`. Returns the files written. Raises InputError as the exporter does."""
    asked = job.options_as(_Export)
    reporter.progress(0.1, f"writing {asked.form}")
    folder = Path(asked.folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = export(asked.form, CaseFolder(Path(asked.case)), folder)
    return {"files": [str(path) for path in files]}
