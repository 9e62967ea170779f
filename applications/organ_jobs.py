"""What the window's worker does with the identified organ: its body for the probe, and the film of its fall."""

from __future__ import annotations

from pathlib import Path

import msgspec

from palpate.applications.drop.fallen import PER_SECOND, SLOWER, film_of
from palpate.applications.dynamics.drop import DropOptions
from palpate.applications.touch.body_file import save_body
from palpate.applications.touch.case_body import TouchStepOptions, body_of
from palpate.case.case_folder import CaseFolder
from palpate.core.worker.job import Job
from palpate.core.worker.lifeline import give_way
from palpate.core.worker.messages import Reporter


class _Organ(msgspec.Struct, frozen=True):
    """Options. case : its folder. file : what is to be made. tets : of the body."""

    case: str
    file: str
    tets: int = TouchStepOptions().tets


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
