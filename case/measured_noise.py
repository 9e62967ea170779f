"""Contour noise measured from repeated contours: noise.json."""

from __future__ import annotations

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError

FILE = "noise.json"


def measured_noise(case: CaseFolder) -> tuple[float, float] | None:
    """Standard deviation and correlation length of the contour noise, mm; None where it was not measured.

    Raises InputError when noise.json lacks them or holds impossible values.
    """
    if not case.has(FILE):
        return None
    noise = case.read_json(FILE)
    try:
        sd, length = float(noise["sd_mm"]), float(noise["correlation_mm"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{case.file(FILE)} holds no sd_mm and correlation_mm; remove it and give --repeat again"
        ) from error
    if not (0.0 < sd < 20.0 and 0.0 < length < 100.0):
        raise InputError(f"{case.file(FILE)} holds values that cannot be; remove it and give --repeat again")
    return sd, length
