"""A scan of the asymmetric phantom, its truth, and its organs as found; made once for all tests."""

from __future__ import annotations

from functools import cache

import numpy as np

from palpate.imaging.volume import Volume
from palpate.segmentation.pelvis import Segmentation, segment_pelvis
from palpate.simulate.phantom import phantom
from palpate.simulate.scanner import Scanner

SPACING = np.array([1.6, 1.6, 2.5])
EXTENT = np.array([350.0, 240.0, 150.0])


@cache
def scan() -> Volume:
    """CT (HU) of the phantom."""
    return Scanner().scan(phantom.hu, _grid(), seed=3)


@cache
def truth() -> Volume:
    """Labels of the phantom on the scan's grid."""
    grid = _grid()
    index = np.indices(grid.array.shape).reshape(3, -1).T.astype(float)
    return grid.with_array(phantom.labels(grid.to_lps(index)).reshape(grid.array.shape))


@cache
def found() -> Segmentation:
    """The organs of the scan, found automatically."""
    return segment_pelvis(scan())


def truth_of(*labels: int) -> Volume:
    """Mask of some labels."""
    return truth().with_array(np.isin(truth().array, labels))


def _grid() -> Volume:
    shape = np.ceil(EXTENT / SPACING).astype(int)
    affine = np.diag([*SPACING, 1.0])
    affine[:3, 3] = phantom.ORIGIN_MM - 0.5 * (shape - 1) * SPACING + np.array([2.0, 10.0, 8.0])
    return Volume(np.zeros(shape, dtype=np.int16), affine)
