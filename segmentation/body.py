"""The body: the largest piece that is not air, without the table."""

from __future__ import annotations

import numpy as np

from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.segmentation.working_grid import AIR_HU, Mask, dilated, eroded, filled, largest

SKIN_HU = -250.0
# Table tops and their padding are thinner than twice this, and touch the body with less.
OPENING_MM = 7.0
SMALLEST_L = 0.3


def body_mask(ct: Volume) -> Mask:
    """Mask of the body, gas within it included. ct : HU on an even upright grid, about 3 mm.

    Raises InputError when the scan holds no body.
    """
    step = float(ct.spacing[0])
    solid = ct.array > SKIN_HU
    # Beyond the first and last slice the body goes on; beyond the sides of the picture it does not.
    sides = np.pad(solid, ((1, 1), (1, 1), (0, 0)))
    core = largest(eroded(sides, OPENING_MM, step))
    if core.sum() * step**3 < SMALLEST_L * 1e6:
        raise InputError(f"the scan holds no body: nothing larger than {SMALLEST_L} litres is above {SKIN_HU:.0f} HU")
    near = dilated(core, OPENING_MM + step, step)
    return largest(filled((near & sides)[1:-1, 1:-1], within=2))


def without_surroundings(ct: Volume, body: Mask) -> Volume:
    """The CT with everything outside the body set to air."""
    return ct.with_array(np.where(body, ct.array, np.float32(AIR_HU)))
