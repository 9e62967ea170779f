"""The report's section on the motion that the images tell: how much came from them, and its picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.matched import read_matched_motion
from palpate.core.matched_motion import REASONS, MatchedMotion
from palpate.core.observe.motion_data import MotionData
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.motion_pictures import SLAB_MM, motion_planes
from palpate.ui.pictures.slices import save
from palpate.ui.report.document import Block, Paragraph, Picture, Section, Table

NAME = "matched_motion"


def motion_pictures(case: CaseFolder, images: CaseImages, folder: Path) -> dict[str, Picture]:
    """The matched motion on the slices as a PNG file in ``folder``; none for a case whose images were not matched."""
    matched = read_matched_motion(case)
    if matched is None:
        return {}
    caption = (
        f"Motion that both CTs' images show, within {SLAB_MM:g} mm of each slice; arrows have their true length. Crosses: "
        "points that were rejected. Bladder, rectum, gas and bone are not matched."
    )
    says = "Slices in three planes with an arrow at every matched point."
    return {NAME: Picture(save(motion_planes(images, matched), folder / f"{NAME}.png"), caption, says)}


def motion_section(matched: MatchedMotion, pictures: Mapping[str, Picture], used: bool) -> Section:
    """What came from the images, and what did not. used : whether the stiffness stands on it."""
    data = MotionData.of(matched)
    counts = np.bincount(matched.rejected_for, minlength=len(REASONS))
    rows = [
        ("points matched", str(len(matched.points))),
        ("directions measured", str(len(data.sd))),
        ("standard deviation of such a direction, median", f"{np.median(data.sd):.2f} mm" if len(data.sd) else "none"),
        *((f"rejected: {why}", str(n)) for why, n in zip(REASONS[1:], counts[1:], strict=True) if n),
    ]
    blocks: list[Block] = [Paragraph(_text(matched, used)), Table(("motion from the images", ""), rows)]
    return Section("Motion from the images", [*blocks, *([pictures[NAME]] if NAME in pictures else [])])


def _text(matched: MatchedMotion, used: bool) -> str:
    if used:
        return "The stiffness above comes from contours, landmarks and this motion together."
    alone = "The stiffness above comes from contours and landmarks alone"
    if not matched.is_of_one_body:
        return f"{alone}: the two CTs do not show the same tissue about the prostate (their HU correlate by {matched.alike:.2f})."
    return f"{alone}, as it was asked for (--no-image); this motion is not used."
