"""The fall of the organs of cases, simulated and filmed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from palpate.applications.drop import fall, film
from palpate.applications.drop.words import stage_of
from palpate.applications.dynamics.drop import DropOptions
from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.core.worker.progress import Progress, part
from palpate.ui.pictures import offscreen

PER_SECOND = 30.0
# How many times slower than real a film runs unless asked otherwise.
SLOWER = 8.0
# Share of the work that the simulation is.
_SIMULATION = 0.75


@dataclass(frozen=True, eq=False)
class Fallen:
    """dropped : what was simulated. codec : of the film."""

    dropped: fall.Dropped
    codec: str


def film_of(cases: Sequence[CaseFolder], options: DropOptions, path: Path, progress: Progress) -> Fallen:
    """Simulates, then draws; the film appears whole or not at all.

    Raises InputError where a case is not identified or this machine cannot draw, ConvergenceError where a motion cannot be followed.
    """
    try:
        offscreen.check()  # this and whether the film can be written: before minutes of simulation, not after
        with atomic_path(path) as temporary:
            dropped = fall.run(cases, options, part(progress, 0.0, _SIMULATION))
            codec = film.make_film(stage_of(dropped, PER_SECOND), temporary, part(progress, _SIMULATION, 1.0))
    except offscreen.OffscreenError as error:
        raise InputError(str(error)) from error
    return Fallen(dropped, codec)
