"""The one kPa scale of a case: the same in report, window, touch and the colour table for 3D Slicer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.identified import read_result
from palpate.core.identify.result_record import ResultRecord
from palpate.ui.pictures.colours import StiffnessScale, map_scale
from palpate.ui.report.regions import RegionStiffness, region_of

MAP_FILE = "identify/stiffness_map.npz"
Arrays = Mapping[str, NDArray[np.generic]]


def case_scale(case: CaseFolder) -> StiffnessScale:
    """The scale of an identified case. Raises InputError where result.json is missing or damaged."""
    result = read_result(case)
    return scale_of(regions_of(result, case.facts), map_arrays(case, result))


def scale_of(regions: Iterable[RegionStiffness], mapped: Arrays | None) -> StiffnessScale:
    """A scale that holds every stiffness that is told. mapped : the map's arrays where there is one."""
    told = [region.G for region in regions if region.told]
    return StiffnessScale.of(told) if mapped is None else map_scale(told, mapped)


def regions_of(result: ResultRecord, facts: CaseFacts) -> tuple[RegionStiffness, ...]:
    """The regions of result.json, in the order of their labels."""
    found = [region_of(name, p, facts, len(result.parameters) == 1) for name, p in result.parameters.items()]
    return tuple(sorted(found, key=lambda region: region.label))


def map_arrays(case: CaseFolder, result: ResultRecord) -> Arrays | None:
    """Arrays of the stiffness map within the organ; None where there is none."""
    return case.read_npz(MAP_FILE) if result.stiffness_map and case.has(MAP_FILE) else None
