"""The repeatability of contours that a case has had measured: noise.json."""

from __future__ import annotations

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError

FILE = "noise.json"


def measured_noise(case: CaseFolder) -> tuple[float, float] | None:
    """sd and correlation length mm from repeats; None where none were made. Raises InputError for a file that does not hold them."""
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
