"""The stiffness that a case has been identified to have."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.core.identify.result_record import ResultRecord
from palpate.imaging.labels import LABELS

_AGAIN = "; run `palpate identify` again"


class KnownStiffness(msgspec.Struct, frozen=True):
    """What who needs the stiffness alone reads of a region: G and its 95 % interval, kPa; None where unknown."""

    G_kpa: float | None = None
    ci95_kpa: tuple[float, float] | None = None


class _Stiffness(msgspec.Struct, frozen=True):
    parameters: dict[str, KnownStiffness]


def read_result(case: CaseFolder) -> ResultRecord:
    """result.json as a whole. Raises InputError when it is missing or not in its form."""
    found = case.read("result.json", ResultRecord, _AGAIN)
    if not found.parameters:
        raise InputError(f"{case.file('result.json')} has no parameters{_AGAIN}")
    return found


def identified_regions(case: CaseFolder) -> dict[str, KnownStiffness]:
    """Of result.json, by region name (``prostate_left``). Raises InputError when it is missing or not in its form."""
    return case.read("result.json", _Stiffness, _AGAIN).parameters


def identified_shear(case: CaseFolder, regions: Sequence[int]) -> dict[int, float]:
    """G in kPa of each of the regions (label values), by result.json. Raises InputError where one is missing or no stiffness."""
    path, found = case.file("result.json"), identified_regions(case)
    shear = {}
    for region in regions:
        G = found.get(LABELS[region], KnownStiffness()).G_kpa
        if G is None:
            raise InputError(f"{path} has no stiffness for '{LABELS[region]}', which the labels hold{_AGAIN}")
        if not (math.isfinite(G) and G > 0.0):
            raise InputError(f"{path} says {G} kPa for {LABELS[region]}{_AGAIN}")
        shear[region] = G
    return shear
