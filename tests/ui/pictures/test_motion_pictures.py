"""The matched motion on the slices, and the section that counts it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.quiver import Quiver

from palpate.core.matched_motion import REASONS, MatchedMotion
from palpate.imaging.labels import PROSTATE_LEFT, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.motion_pictures import motion_planes
from palpate.ui.report.document import Paragraph, Table
from palpate.ui.report.motion_section import motion_section


def images() -> CaseImages:
    labels = np.full((40, 40, 40), SURROUNDING_TISSUE, dtype=np.uint8)
    labels[15:25, 15:25, 15:25] = PROSTATE_LEFT
    return CaseImages(Volume(labels, np.diag([2.0, 2.0, 2.0, 1.0])), stiffness_kpa={PROSTATE_LEFT: 30.0})


def matched() -> MatchedMotion:
    middle = np.full(3, 39.0)
    points = np.array([middle, middle + [0.0, 0.0, 12.0]])
    rejected = np.hstack([middle + [6.0, 0.0, 0.0], np.ones(3)])[None]
    return MatchedMotion(
        points, np.tile([1.0, -2.0, 3.0], (2, 1)), np.tile(np.eye(3), (2, 1, 1)), 10.0, rejected, np.array([1])
    )


def test_a_point_is_drawn_on_the_slices_near_it_with_its_true_length() -> None:
    axial, sagittal, coronal = motion_planes(images(), matched()).axes[:3]
    arrows = [next(a for a in ax.collections if isinstance(a, Quiver)) for ax in (axial, sagittal, coronal)]
    assert [a.N for a in arrows] == [1, 2, 2]
    assert (arrows[0].U[0], arrows[0].V[0]) == (1.0, -2.0)
    assert (arrows[1].U[0], arrows[1].V[0]) == (-2.0, 3.0)
    crosses = [line for line in axial.lines if line.get_marker() == "x"]
    assert len(crosses) == 1 and len(crosses[0].get_xdata()) == 1


def test_the_section_counts_what_was_matched_and_why_points_were_not_used() -> None:
    section = motion_section(matched(), {}, used=False)
    table = next(block for block in section.blocks if isinstance(block, Table))
    rows = {row[0]: row[1] for row in table.rows}
    assert rows["points matched"] == "2" and rows["directions measured"] == "6"
    assert rows[f"rejected: {REASONS[1]}"] == "1"


def test_the_section_says_whether_the_stiffness_stands_on_the_motion() -> None:
    without, with_it = (next(iter(motion_section(matched(), {}, used=used).blocks)) for used in (False, True))
    assert isinstance(without, Paragraph) and "alone" in without.text
    assert isinstance(with_it, Paragraph) and "this motion together" in with_it.text


def test_the_section_says_that_two_scans_do_not_show_the_same() -> None:
    (said, *_) = motion_section(replace(matched(), alike=0.41), {}, used=False).blocks
    assert isinstance(said, Paragraph) and "do not show the same tissue" in said.text and "0.41" in said.text
    assert "--no-image" not in said.text
