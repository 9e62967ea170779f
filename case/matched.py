"""Motion that the images of a case tell, written by the match step."""

from __future__ import annotations

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.core.matched_motion import LEAST_ALIKE, MatchedMotion

FILE = "matched_motion.npz"


def has_both_scans(case: CaseFolder) -> bool:
    """Whether the case holds the CTs of both states."""
    return all(case.has(f"{state}_ct") for state in ("rest", "deformed"))


def wants_image(case: CaseFolder, asked: bool | None) -> bool:
    """Whether a fit uses the motion that the images tell: as asked for; where nobody did (None), where the case holds both CTs."""
    return has_both_scans(case) if asked is None else asked


def left_out(matched: MatchedMotion | None) -> str:
    """Why the motion that was found is not used, as a line before the results; "" where it is."""
    if matched is None or matched.is_of_one_body:
        return ""
    return (
        f"two CTs that show the same tissue about the prostate (their HU correlate by {matched.alike:.2f} under the best motion that was "
        f"found, {LEAST_ALIKE:g} is needed): the images were left out. Look whether both series are of this patient and lie as the "
        "contours do"
    )


def read_matched_motion(case: CaseFolder) -> MatchedMotion | None:
    """The matched motion; None where nothing was matched. Raises InputError when the file is damaged."""
    if not case.has(FILE):
        return None
    try:
        return MatchedMotion.from_arrays(case.read_npz(FILE))
    except KeyError as error:
        raise InputError(f"{case.file(FILE)} lacks {error}; remove it and diagnose again") from error
