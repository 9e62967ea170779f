"""Identified stiffness of a case, from result.json."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.core.identify.result_record import ResultRecord
from palpate.imaging.labels import LABELS

MAP_FILE = "identify/stiffness_map.npz"
_AGAIN = "; run `palpate identify` again"


class KnownStiffness(msgspec.Struct, frozen=True):
    """Shear modulus G of a region and its 95 % interval, kPa; None where unknown."""

    G_kpa: float | None = None
    ci95_kpa: tuple[float, float] | None = None


class _Stiffness(msgspec.Struct, frozen=True):
    parameters: dict[str, KnownStiffness]


def read_result(case: CaseFolder) -> ResultRecord:
    """Whole content of result.json. Raises InputError when it is missing, does not have its form or has no
    parameters.
    """
    result = case.read("result.json", ResultRecord, _AGAIN)
    if not result.parameters:
        raise InputError(f"{case.file('result.json')} has no parameters{_AGAIN}")
    return result


def map_arrays(case: CaseFolder, result: ResultRecord) -> Mapping[str, NDArray[np.generic]] | None:
    """Arrays of the stiffness map within the organ; None where there is none."""
    return case.read_npz(MAP_FILE) if result.stiffness_map and case.has(MAP_FILE) else None


def identified_regions(case: CaseFolder) -> dict[str, KnownStiffness]:
    """Stiffness by region name (``prostate_left``). Raises InputError when result.json is missing or lacks its form."""
    return case.read("result.json", _Stiffness, _AGAIN).parameters


def identified_shear(case: CaseFolder, regions: Sequence[int]) -> dict[int, float]:
    """Shear modulus G, kPa, by region (label value).

    Raises InputError when result.json is missing, lacks one of the regions, or holds a G that is not positive and
    finite.
    """
    path, known = case.file("result.json"), identified_regions(case)
    shear = {}
    for region in regions:
        G = known.get(LABELS[region], KnownStiffness()).G_kpa
        if G is None:
            raise InputError(f"{path} has no stiffness for '{LABELS[region]}', which the labels hold{_AGAIN}")
        if not (math.isfinite(G) and G > 0.0):
            raise InputError(f"{path} says {G} kPa for {LABELS[region]}{_AGAIN}")
        shear[region] = G
    return shear
