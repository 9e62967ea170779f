"""What is known of a rectum's course before it is seen.

What reads "Chosen" was looked at on twelve variants of two CTs and the phantom, on which no figure is quoted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from palpate.core.sourced_number import sourced


@dataclass(frozen=True, kw_only=True)
class CourseOptions:
    """What is known of a rectum's course before it is seen, and how the picture is weighed against that."""

    step_mm: Annotated[
        float, sourced("mm", "Distance of the centres and heights tried.", "Chosen: a fifth of a radius.")
    ] = 2.5
    radii_mm: Annotated[
        tuple[float, ...], sourced("mm", "Radii tried.", "Empty to gas-filled rectum: 2 to 5 cm wide.")
    ] = (9.0, 12.0, 15.0, 19.0, 24.0)
    beside_sd_mm: Annotated[
        float,
        sourced("mm", "Spread of the centre about the midline.", "Lateral flexures move it by a half of its radius."),
    ] = 7.0
    before_bone_mm: Annotated[
        tuple[float, float],
        sourced(
            "mm",
            "Centre in front of sacrum and coccyx: usual, and spread.",
            "Presacral space of 1 cm, and a radius; at the flexures it leaves them.",
        ),
    ] = (25.0, 9.0)
    behind_mm: Annotated[
        tuple[float, float],
        sourced(
            "mm",
            "Centre behind the symphysis below the coccyx: usual, and spread.",
            "H line, from the pubis to behind the anorectal junction, of 5 to 6 cm, less a radius.",
        ),
    ] = (48.0, 10.0)
    place_weight: Annotated[
        float,
        sourced(
            "1", "Weight of the place against the picture.", "Chosen: two spreads cost a third of a full contrast."
        ),
    ] = 0.2
    gas_weight: Annotated[
        float,
        sourced(
            "1", "What a disc gains by the gas in it, for a usual section full of it.", "Chosen: as a full contrast."
        ),
    ] = 1.0
    usual_mm: Annotated[
        tuple[float, float],
        sourced("mm, 1", "Usual radius, and spread of its logarithm.", "Rectum of 3 cm, 2 to 4.5 cm."),
    ] = (14.0, 0.4)
    move_mm: Annotated[
        tuple[float, float],
        sourced("mm", "Move from one height to the next: usual, and most.", "Folds displace a lumen by its radius."),
    ] = (4.0, 10.0)
    move_weight: Annotated[
        float,
        sourced("1", "Cost of a usual move, and of the next size.", "Chosen: an eighth of a full contrast."),
    ] = 0.12
    levator_mm: Annotated[
        float,
        sourced(
            "mm", "Muscle about the rectum below the middle of the symphysis.", "Levator ani and sphincter: 4 to 6 mm."
        ),
    ] = 5.0
    stretch_mm: Annotated[
        float, sourced("mm", "Length of the best stretch, by which a course is believed.", "Chosen: half a width.")
    ] = 15.0
    least_score: Annotated[
        float,
        sourced("1", "Mean agreement of that stretch, at least.", "Chosen: a disc with fat on a quarter of its rim."),
    ] = 0.25
