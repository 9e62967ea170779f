"""The fall of the organs of cases, simulated and filmed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.applications.drop import fall, film
from palpate.applications.drop.fall import Dropped, IdentifiedOrgan
from palpate.applications.drop.stage import DropStage, FallingOrgan
from palpate.applications.dynamics.drop import DropOptions
from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.core.worker.progress import Progress, part
from palpate.imaging.labels import PROSTATE_LEFT, PROSTATE_RIGHT
from palpate.ui.pictures import offscreen
from palpate.ui.pictures.colours import STIFFNESS_LABEL, STIFFNESS_SCALE
from palpate.ui.words.number_words import three_figures

PER_SECOND = 30.0
# How many times slower than real a film runs unless asked otherwise.
SLOWER = 8.0
# Share of the work that the simulation is.
_SIMULATION = 0.75
_SIDES = {PROSTATE_LEFT: "left", PROSTATE_RIGHT: "right"}


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


def stage_of(dropped: Dropped, per_second: float) -> DropStage:
    """The film's stage: organs in the colours of one scale, without a word on whose they are."""
    scale = STIFFNESS_SCALE
    falling = []
    for organ, one in zip(dropped.organs, dropped.drops, strict=True):
        colours = {region: scale.rgb(G) for region, G in organ.stiffness_kpa.items()}
        rgb = np.array([colours[int(region)] for region in one.regions])
        falling.append(FallingOrgan(f"Organ {organ.name}", subtitle(organ), one.points, one.faces, rgb))
    bar = tuple((float(scale.norm(t)), f"{t:g}") for t in (scale.low, 50.0, scale.high))
    along = np.array([scale.colormap(share)[:3] for share in np.linspace(0.0, 1.0, 128)])
    dish = dropped.dish
    return DropStage(
        tuple(falling), dish.points, dish.faces, dropped.drops[0].times, per_second, bar, STIFFNESS_LABEL, along
    )


def subtitle(organ: IdentifiedOrgan) -> str:
    """G of each side, kPa."""
    sides = ", ".join(f"{_SIDES[region]} {three_figures(G)} kPa" for region, G in sorted(organ.stiffness_kpa.items()))
    return f"shear modulus G: {sides}"
