"""Motion of the tissue about an organ between two contoured CTs, from their images."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.core.matched_motion import MatchedMotion
from palpate.imaging.grid import cropped, labels_on
from palpate.imaging.labels import ORGAN_LABELS
from palpate.imaging.matching.local_matching import LocalMatches, MatchOptions, match
from palpate.imaging.matching.masks import bright_spots, distance_to_organ, usable_voxels
from palpate.imaging.matching.outliers import reasons
from palpate.imaging.matching.scan_pair import Motion
from palpate.imaging.matching.scores import window_scores
from palpate.imaging.matching.window_errors import less_sure
from palpate.imaging.matching.window_fits import LEAST_SPREAD_HU
from palpate.imaging.matching.window_sums import TRUNCATE
from palpate.imaging.volume import Volume

# Range of HU in which tissue is told apart.
_HU = (-300.0, 400.0)
# How far from the organ points are matched, and how much farther the deformed scan is read, mm.
REACH_MM, _FARTHER_MM = 25.0, 15.0
# Precision, 1/mm2, below which a direction is not told: a standard deviation of 3 mm.
_TOLD = 1.0 / 9.0
# Rounds in which a motion is turned round, and the distance that its steps are about.
_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class LabelledScan:
    """ct : HU. labels : of organ, bladder and rectum, on any grid."""

    ct: Volume
    labels: Volume


def matched_motion(
    rest: LabelledScan, deformed: LabelledScan, predicted: Motion, options: MatchOptions | None = None
) -> MatchedMotion:
    """Motion from the scan at rest to the deformed one, at points within REACH_MM of the organ.

    rest, deformed : in one frame. predicted : displacement (n, 3) mm at points (n, 3) mm, which matching starts from.
    Raises InputError when the labels at rest hold no organ or the scans do not overlap there.
    """
    options = options or MatchOptions()
    margin = REACH_MM + TRUNCATE * options.levels[-1].window_mm
    low, high = _bounds(rest.labels)
    first = _cropped(rest, low - margin, high + margin)
    second = _cropped(deformed, low - margin - _FARTHER_MM, high + margin + _FARTHER_MM)
    distance = distance_to_organ(first.labels)
    near = distance < margin
    usable = usable_voxels(first.ct, first.labels) & near, usable_voxels(second.ct, second.labels)
    ours, theirs = (v.ct.with_array(np.clip(v.ct.array, *_HU).astype(np.float32)) for v in (first, second))

    def backwards(points: FloatArray) -> FloatArray:
        return inverse_of(predicted, points)

    with ThreadPoolExecutor(2) as both:  # most of the time goes to sampling, during which scipy lets other threads run
        forth = both.submit(match, ours, theirs, usable, predicted, options, bright_spots(first.ct, first.labels))
        back = match(theirs, ours, (usable[1], usable[0]), backwards, options)
        found = forth.result()
    found = _chosen(found, first.ct.with_array(distance).at(found.points) <= REACH_MM)
    there = found.points + found.displacement
    return _judged(found, found.displacement + inverse_of(predicted, there) + back.beyond.at(there))


def inverse_of(motion: Motion, points: FloatArray) -> FloatArray:
    """Displacement (n, 3) mm that takes points (n, 3) mm back to where the motion brings them from."""
    back = -motion(points)
    for _ in range(_ROUNDS):
        back = -motion(points + back)
    return back


def _judged(found: LocalMatches, back: FloatArray) -> MatchedMotion:
    why = reasons(found, back)
    told = np.linalg.eigvalsh(less_sure(found.cautious, back))[:, -1] > _TOLD
    good, bad = told & (why == 0), told & (why > 0)
    rejected = np.hstack([found.points[bad], found.displacement[bad]])
    scores = window_scores(found.compared, found.windows[why == 0]) if (why == 0).any() else None
    return MatchedMotion(
        found.points[good],
        found.displacement[good],
        found.precision[good],
        found.correlation_mm,
        rejected,
        why[bad],
        scores,
        _alike(found),
    )


def _alike(found: LocalMatches) -> float:
    """Correlation of both scans under the motion, where both are usable; 0 where one of them shows nothing."""
    at, first = found.compared.at, found.compared.pair.first
    seen = at.weight > 0.5
    ours, theirs = first[seen], (first - at.difference)[seen]
    if len(ours) < 2 or min(float(ours.std()), float(theirs.std())) < LEAST_SPREAD_HU:
        return 0.0
    return float(np.corrcoef(ours, theirs)[0, 1])


def _chosen(found: LocalMatches, keep: BoolArray) -> LocalMatches:
    names = ("points", "displacement", "precision", "cautious", "shift", "left_hu", "windows")
    return replace(found, **{name: getattr(found, name)[keep] for name in names})


def _bounds(labels: Volume) -> tuple[FloatArray, FloatArray]:
    index = np.argwhere(np.isin(labels.array, ORGAN_LABELS))
    if not len(index):
        raise InputError("the labels at rest hold no prostate: there is nothing to match the scans about")
    places = labels.to_lps(index.astype(float))
    return places.min(axis=0), places.max(axis=0)


def _cropped(scan: LabelledScan, low: FloatArray, high: FloatArray) -> LabelledScan:
    """The part of a scan in a box of patient coordinates (3,) mm, axes along LPS, labels on its grid."""
    part = cropped(scan.ct, low, high)
    return LabelledScan(part, labels_on(scan.labels, part))
