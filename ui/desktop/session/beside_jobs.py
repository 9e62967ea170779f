"""Jobs in the window's worker that are no step: export to other programs, the organ's body for the probe, the film of its fall."""

from __future__ import annotations

from pathlib import Path

import msgspec

from palpate.case.case_folder import CaseFolder
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter
from palpate.ui.export import export

KIND = "palpate.ui.desktop.session.beside_jobs:run"
# What does the jobs on the organ, which nothing here imports: a job names it.
_BY = "palpate.applications.organ_jobs"


class _Export(msgspec.Struct, frozen=True):
    """Options. case : its folder. form : one of `export.names`. folder : where the files go."""

    case: str
    form: str
    folder: str


def export_job(case: Path, form: str, folder: Path, scratch: Path) -> Job:
    """The job that writes a case. scratch : for its messages and log."""
    return Job(KIND, str(scratch), options={"case": str(case), "form": form, "folder": str(folder)})


def run(job: Job, reporter: Reporter) -> dict[str, object]:
    """Options as `_Export`. Returns the files written. Raises InputError as the exporter does."""
    asked = job.options_as(_Export)
    reporter.progress(0.1, f"writing {asked.form}")
    folder = Path(asked.folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = export(asked.form, CaseFolder(Path(asked.case)), folder)
    return {"files": [str(path) for path in files]}


def body_job(case: Path, scratch: Path) -> Job:
    """The job that makes the body to touch. scratch : for its messages and log, and for the body."""
    return _job("make_body", case, scratch / "body.npz", scratch)


def film_job(case: Path, film: Path, scratch: Path) -> Job:
    """The job that films the fall, as `palpate drop` does without options. scratch : for its messages and log."""
    return _job("make_film", case, film, scratch)


def _job(name: str, case: Path, file: Path, scratch: Path) -> Job:
    return Job(f"{_BY}:{name}", str(scratch), options={"case": str(case), "file": str(file)})
