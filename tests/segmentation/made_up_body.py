"""A small made-up pelvis as labels: prostate in two halves, rectum behind, bladder above, all in a block of tissue."""

from __future__ import annotations

import numpy as np
from voxel_shapes import ball, grid, paint, prostate, tube

from palpate.imaging.volume import Volume


def body() -> Volume:
    """Labels of docs/case.md on a grid of 2 mm."""
    labels = grid((2.0, 2.0, 2.0), (40.0, 40.0, 40.0), np.zeros(3))
    labels = paint(labels.with_array(labels.array + 3), lambda p: 0.7 * prostate(p / 0.7), 2)
    left = (labels.to_lps(np.argwhere(labels.array >= 0).astype(float))[:, 0] > 0.0).reshape(labels.array.shape)
    labels = labels.with_array(np.where((labels.array == 2) & left, 1, labels.array))
    labels = paint(labels, tube(7.0, 0.0, 26.0), 6)
    return paint(labels, ball(9.0, (0.0, -14.0, 26.0)), 5)
