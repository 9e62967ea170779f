"""Jobs on the identified organ in the window's worker: its body for the probe, and the film of its fall."""

from __future__ import annotations

from pathlib import Path

import msgspec

from palpate.case.case_folder import CaseFolder
from palpate.case.steps.touch import TouchStepOptions, body_of
from palpate.core.dynamics.drop import DropOptions
from palpate.core.touch.body_file import save_body
from palpate.core.worker.job import Job
from palpate.core.worker.lifeline import give_way
from palpate.core.worker.messages import Reporter
from palpate.ui.pictures.drop.fallen import PER_SECOND, SLOWER, film_of

_HERE = "palpate.ui.desktop.session.organ_jobs"


class _Organ(msgspec.Struct, frozen=True):
    """Options. case : its folder. file : what is to be made. tets : of the body."""

    case: str
    file: str
    tets: int = TouchStepOptions().tets


def body_job(case: Path, scratch: Path) -> Job:
    """The job that makes the body to touch. scratch : for its messages and log, and for the body."""
    return _job("make_body", case, scratch / "body.npz", scratch)


def film_job(case: Path, film: Path, scratch: Path) -> Job:
    """The job that films the fall, as `palpate drop` does without options. scratch : for its messages and log."""
    return _job("make_film", case, film, scratch)


def make_body(job: Job, reporter: Reporter) -> dict[str, object]:
    """Returns the file of the body. Raises InputError as `body_of` does."""
    give_way()
    asked = job.options_as(_Organ)
    body = body_of(CaseFolder(Path(asked.case)), TouchStepOptions(asked.tets), reporter.progress)
    save_body(Path(asked.file), body)
    return {"body": asked.file}


def make_film(job: Job, reporter: Reporter) -> dict[str, object]:
    """Returns the file of the film. Raises InputError as `film_of` does."""
    give_way()
    asked = job.options_as(_Organ)
    film_of(
        [CaseFolder(Path(asked.case))], DropOptions(frames=PER_SECOND * SLOWER), Path(asked.file), reporter.progress
    )
    return {"film": asked.file}


def _job(name: str, case: Path, file: Path, scratch: Path) -> Job:
    return Job(f"{_HERE}:{name}", str(scratch), options={"case": str(case), "file": str(file)})
