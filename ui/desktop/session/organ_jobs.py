"""Jobs on the identified organ in the window's worker: its body for the probe, and the film of its fall.

They are done by `applications/organ_jobs.py`, which nothing here imports: a job names what does it.
"""

from __future__ import annotations

from pathlib import Path

from palpate.core.worker.job import Job

_BY = "palpate.applications.organ_jobs"


def body_job(case: Path, scratch: Path) -> Job:
    """The job that makes the body to touch. scratch : for its messages and log, and for the body."""
    return _job("make_body", case, scratch / "body.npz", scratch)


def film_job(case: Path, film: Path, scratch: Path) -> Job:
    """The job that films the fall, as `palpate drop` does without options. scratch : for its messages and log."""
    return _job("make_film", case, film, scratch)


def _job(name: str, case: Path, file: Path, scratch: Path) -> Job:
    return Job(f"{_BY}:{name}", str(scratch), options={"case": str(case), "file": str(file)})
