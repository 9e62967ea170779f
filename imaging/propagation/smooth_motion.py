"""The smooth motion between two scans by matching from coarse to fine, without a prediction to start from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.matching.local_matching import Level
from palpate.imaging.matching.scan_pair import ScanPair
from palpate.imaging.matching.window_errors import variance_left
from palpate.imaging.matching.window_fits import shifts, smooth_field
from palpate.imaging.propagation.compared_scans import ComparedScans, DrawnScan
from palpate.imaging.propagation.options import PropagationOptions
from palpate.imaging.volume import Volume


@dataclass(frozen=True, eq=False)
class SmoothMotion:
    """pair : both scans at the finest resolution. motion : displacement (mi, mj, mk, 3) mm on a lattice."""

    pair: ScanPair
    motion: Volume

    @property
    def alike(self) -> float:
        """Correlation of both images where they are compared, under the motion."""
        nodes = self.pair.windows.nodes
        there, weight = self.pair.moved(self.motion.at(nodes.reshape(-1, 3)).reshape(nodes.shape))
        used = weight > 0.5
        if used.sum() < 2:
            return 0.0
        return float(np.corrcoef(self.pair.first[used], there[used])[0, 1])


def smooth_motion(drawn: DrawnScan, other: Volume, options: PropagationOptions) -> SmoothMotion:
    """From the scan that was drawn to the other one, both in one frame.

    Hollow organs hold something else in every scan: their contents are left out, at first in the drawn scan alone, then
    also where the motion that was found takes them. Raises InputError where the scans do not overlap about the contours.
    """
    scans = ComparedScans.of(drawn, other, options.wall_mm)
    rough = _matched(scans, options.first, None)
    return _matched(
        scans.without_contents(drawn.organs, rough.motion.at, options.wall_mm), options.second, rough.motion
    )


def _matched(scans: ComparedScans, levels: Sequence[Level], start: Volume | None) -> SmoothMotion:
    motion = start
    for level in levels:
        pair = ScanPair.of(scans.first, scans.second, scans.usable, np.zeros_like, level.smoothing_mm, level.window_mm)
        nodes = pair.windows.nodes
        field = np.zeros_like(nodes) if motion is None else motion.at(nodes.reshape(-1, 3)).reshape(nodes.shape)
        for _ in range(level.rounds):
            field = field + _round(pair, field, level.iterations)
        motion = pair.windows.lattice.with_array(field)
    assert motion is not None
    return SmoothMotion(pair, motion)


def _round(pair: ScanPair, field: FloatArray, iterations: int) -> FloatArray:
    """Windows' shifts averaged over neighbours, by what each knows: texture over what is left of the difference, so that
    contents of a hollow organ which slip into a window do not lead it."""
    shift, at = shifts(pair, field, iterations)
    left = variance_left(pair, at)
    return smooth_field(pair, shift, at.A * (np.median(left) / left)[..., None, None])
