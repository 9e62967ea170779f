"""How far rectum and bladder of a simulated patient fill or empty between two scans."""

from __future__ import annotations

import numpy as np

from palpate.simulate.walls import BladderSpec, RectumSpec

Filling = tuple[RectumSpec, BladderSpec]


def drawn_filling(rng: np.random.Generator, empties: float = 0.25) -> Filling:
    """A filling. empties : probability that the rectum empties, and the bladder fills, rather than the other way round."""
    is_emptied = bool(rng.random() < empties)
    return rectum_filling(is_emptied, rng), bladder_filling(is_emptied, rng)


def scaled_filling(filling: Filling, share: float) -> Filling:
    """The same motions, so much smaller or larger."""
    rectum, bladder = filling
    change = bladder.volume_change_cc
    return (
        RectumSpec(
            share * rectum.inflate_mm,
            rectum.bias,
            _scaled(rectum.push_mm, share),
            rectum.middle_mm,
            rectum.half_length_mm,
        ),
        BladderSpec(None if change is None else share * change, bladder.balance, _scaled(bladder.push_mm, share)),
    )


def rectum_filling(empties: bool, rng: np.random.Generator) -> RectumSpec:
    """Of a rectum that fills or empties."""
    back = float(rng.uniform(1.0, 3.0) if empties else -rng.uniform(2.0, 6.0))
    return RectumSpec(
        inflate_mm=float(rng.uniform(-7.0, -5.0) if empties else rng.uniform(6.5, 10.0)),
        bias=(float(rng.uniform(-0.4, 0.4)), float(rng.uniform(-0.2, 0.2))),
        push_mm=(float(rng.uniform(-1.5, 1.5)), back, 0.0),
        middle_mm=float(rng.uniform(-8.0, 8.0)),
        half_length_mm=float(rng.uniform(28.0, 38.0)),
    )


def bladder_filling(empties: bool, rng: np.random.Generator) -> BladderSpec:
    """Of a bladder that fills while the rectum empties, or empties while it fills."""
    up = float(-rng.uniform(2.0, 5.0) if empties else rng.uniform(0.0, 2.0))
    return BladderSpec(balance=float(rng.uniform(0.3, 1.0)), push_mm=(0.0, float(rng.uniform(0.0, 2.0)), up))


def _scaled(v: tuple[float, float, float], share: float) -> tuple[float, float, float]:
    return share * v[0], share * v[1], share * v[2]
