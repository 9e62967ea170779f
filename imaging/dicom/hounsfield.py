"""Whether a CT's values can be Hounsfield units: air at -1000, tissue around water."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray, NumberArray
from palpate.core.errors import InputError
from palpate.imaging.volume import Volume

AIR_HU = -1000.0
# Values further than this from AIR_HU are not air; scanners are calibrated to some ten HU, and round.
_NEAR_HU = 150.0
# A level that fewer voxels share is noise, or a bubble.
_SHARE = 0.005
# Fat, the lightest tissue beside lung, has -120 HU: nothing without air lies above this throughout.
_NO_BODY_HU = 300.0
# Tissue lies this much above air.
_TISSUE_HU = (850.0, 1250.0)
# Of the voxels are tissue, where there is a body.
_LEAST_TISSUE = 0.05
# Nothing that shows a body lies below this throughout: fat is denser.
_NO_TISSUE_HU = -300.0
_MOST_VALUES = 500_000
# What surrounds a body is of one value within this (HU), on this share of the pictures' edges; the body lies this much above it (HU).
# Chosen: air has a noise of some 10 HU at a scanner, a table or an arm may reach an edge, and fat lies 90 HU above air at a tenth of the
# scale, the wildest that is looked for.
_SAME_HU, _SURROUNDS, _ABOVE_HU = 15.0, 0.9, 50.0
# Fat has about -120 to -80 HU and muscle 40 to 80 (Chosen: the usual ranges of textbooks, fat's lower end and, as far above water, room
# for contrast): of the voxels in the range of soft tissue a quarter at least lies above the first
# and below the second, however much fat there is.
_SOFT_RANGE_HU = (-500.0, 300.0)
_SOFT_HU = (-120.0, 120.0)
_FAT_HU = (-150.0, -50.0)
# Metal saturates below this, HU, on every scale.
_MOST_HU = 31_000.0


def check_hounsfield(volume: Volume, source: object, each_slice: bool = False) -> None:
    """Raises InputError naming ``source`` when a CT's values are shifted against Hounsfield units, as without their intercept.

    A scan that shows no air passes unless all of it is denser than a body can be.
    each_slice : whether slices were scaled differently, so that one alone may be shifted.
    """
    array = volume.array
    parts = [array] if not each_slice else [array, *(array[:, :, k] for k in range(array.shape[2]))]
    for part in parts:
        lowest = _shifted(part)
        if lowest is not None:
            where = "no voxel is" if part is array else "slices hold no voxel that is"
            raise InputError(
                f"{source}: {where} air at -1000 HU, the lowest lie at {lowest:.0f}: the values are no Hounsfield units "
                "(RescaleIntercept lost?); export the series again"
            )

    scaled = _surrounding_level(array)
    if scaled is not None:
        raise InputError(
            f"{source}: no voxel is air at -1000 HU, what surrounds the body lies at {scaled:.0f} and nothing above "
            f"{_NO_BODY_HU:g}: the values are no Hounsfield units (RescaleSlope wrong?); export the series again"
        )


def refuse_other_scales(volume: Volume, source: object) -> None:
    """Raises InputError unless values show Hounsfield units by themselves, for files that do not state their scale.

    Air or fat must be there, and soft tissue: MR, windowed or normalised pictures have none of the first two.
    """
    values = volume.array.reshape(-1)
    values = values[:: max(1, len(values) // _MOST_VALUES)].astype(np.float64)
    air = (np.abs(values - AIR_HU) < _NEAR_HU).mean()
    body = values[values > _SOFT_RANGE_HU[0]]
    fat = ((body > _FAT_HU[0]) & (body < _FAT_HU[1])).mean() if len(body) else 0.0
    soft = ((values > _SOFT_HU[0]) & (values < _SOFT_HU[1])).mean()
    if soft < _LEAST_TISSUE or (air < _SHARE and fat < _LEAST_TISSUE):
        raise InputError(
            f"{source}: its values, {values.min():.4g} to {values.max():.4g}, are no Hounsfield units (air at -1000, fat at -100, soft "
            "tissue at 0 to 100); give a CT in HU"
        )
    if values.max() > _MOST_HU:
        raise InputError(f"{source}: it has values of {values.max():.4g}, which are no HU; set them to air or metal")


def soft_tissue_note(volume: Volume) -> list[str]:
    """A note on a body in air whose soft tissue does not lie where fat and muscle do, as in a cone-beam scan not calibrated."""
    values = volume.array.reshape(-1)
    values = values[:: max(1, len(values) // _MOST_VALUES)].astype(np.float64)
    soft = values[(values > _SOFT_RANGE_HU[0]) & (values < _SOFT_RANGE_HU[1])]
    shows_a_body = (np.abs(values - AIR_HU) < _NEAR_HU).mean() > 10.0 * _SHARE
    if not shows_a_body or len(soft) < _LEAST_TISSUE * len(values):
        return []
    quarter, median, three = np.percentile(soft, [25.0, 50.0, 75.0])
    if three >= _SOFT_HU[0] and quarter <= _SOFT_HU[1]:
        return []
    return [
        f"the HU are off: soft tissue lies at {median:.0f} HU (median) where fat has about -100 and muscle 50; bones and organs that are "
        "found by their HU may be wrong: calibrate the scan"
    ]


def _surrounding_level(array: NumberArray) -> float | None:
    """What surrounds a body, HU, where that is no air and nothing is bone: a scale that is too small; None otherwise."""
    edge = np.concatenate([array[[0, -1]].reshape(-1), array[:, [0, -1]].reshape(-1)]).astype(np.float64)
    level = float(np.median(edge))
    values = array.reshape(-1)[:: max(1, array.size // _MOST_VALUES)]
    one_level = (np.abs(edge - level) < _SAME_HU).mean() > _SURROUNDS
    between = values.min() > _NO_TISSUE_HU and values.max() < _NO_BODY_HU
    return level if one_level and between and np.percentile(values, 99.0) > level + _ABOVE_HU else None


def _shifted(array: NumberArray) -> float | None:
    """The lowest values (first percentile), HU, where they show a shift; None where all may be as it is."""
    values = array.reshape(-1)
    values = values[:: max(1, len(values) // _MOST_VALUES)].astype(np.float64)
    if (values < AIR_HU - 2.0 * _NEAR_HU).any() and np.percentile(values, 99.0) < _NO_TISSUE_HU:
        return float(np.percentile(values, 1.0))  # taken off twice
    values = values[values > AIR_HU - 2.0 * _NEAR_HU]  # padding
    if len(values) == 0 or (np.abs(values - AIR_HU) < _NEAR_HU).mean() > _SHARE:
        return None
    lowest = float(np.percentile(values, 1.0))
    shifted = lowest > _NO_BODY_HU or (lowest > AIR_HU + _NEAR_HU and _two_levels(values, lowest))
    return lowest if shifted else None


def _two_levels(values: FloatArray, lowest: float) -> bool:
    """Whether there is a level at ``lowest``, and most of the rest lies above it as tissue lies above air."""
    level = np.abs(values - lowest) < 0.5 * _NEAR_HU
    rest = values[values > lowest + _NEAR_HU]
    if level.mean() < 10.0 * _SHARE or len(rest) < _LEAST_TISSUE * len(values):
        return False
    tissue = float(np.median(rest)) - lowest
    return _TISSUE_HU[0] < tissue < _TISSUE_HU[1]
