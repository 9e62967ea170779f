"""The stiffness that a case has been identified to have."""

from __future__ import annotations

import math
from collections.abc import Sequence

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.imaging.labels import LABELS


def identified_shear(case: CaseFolder, regions: Sequence[int]) -> dict[int, float]:
    """G in kPa of each of the regions (label values), by result.json. Raises InputError where one is missing or no stiffness."""
    path, again = case.file("result.json"), "run `palpate identify` again"
    try:
        found = {r: float(case.read_json("result.json")["parameters"][LABELS[r]]["G_kpa"]) for r in regions}
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} has no stiffness for {error}, which the labels hold; {again}") from error
    for region, G in found.items():
        if not (math.isfinite(G) and G > 0.0):
            raise InputError(f"{path} says {G} kPa for {LABELS[region]}; {again}")
    return found
