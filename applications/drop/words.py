"""From organs that fell to what their film shows."""

from __future__ import annotations

import numpy as np

from palpate.applications.drop.fall import Dropped, IdentifiedOrgan
from palpate.applications.drop.stage import DropStage, FallingOrgan
from palpate.imaging.labels import PROSTATE_LEFT, PROSTATE_RIGHT
from palpate.ui.pictures.colours import STIFFNESS_LABEL, STIFFNESS_SCALE
from palpate.ui.words.number_words import three_figures

_SIDES = {PROSTATE_LEFT: "left", PROSTATE_RIGHT: "right"}


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
