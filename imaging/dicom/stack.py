"""Whether slices make one regular volume: order, gaps, tilt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.dicom.slices import Slice

MIN_SLICES = 3
SAME_PLACE_MM = 1e-3
# Scanners round positions: 0.625 mm apart is written 0.6, 0.7, 0.6.
EVEN_WITHIN_MM = 0.06
# A gap this much wider than the usual one, alone, is a missing slice; in a row of its like it is a coarser part.
WIDE_GAP = 1.5
COARSER_ROW = 3
# The widest gap that is interpolated across, relative to the usual one.
WIDEST_GAP = 2.05


@dataclass(frozen=True, eq=False)
class Stack:
    """Slices in the order of their position.

    positions : (n,) mm along the slices' normal. step : (3,) the way from slice to slice per mm of position; equals the
    normal unless the gantry was tilted. even : whether all gaps are the same. gap : mm, the usual gap.
    """

    slices: tuple[Slice, ...]
    positions: FloatArray
    step: FloatArray
    even: bool
    gap: float

    @property
    def shift(self) -> FloatArray:
        """In-plane shift (3,) per mm of position; zero unless the gantry was tilted."""
        return self.step - self.slices[0].normal


def in_order(slices: Sequence[Slice], folder: object) -> tuple[list[Slice], FloatArray]:
    """The slices sorted by position along their normal, and the positions (n,) mm.

    Raises InputError when they differ in size, pixel spacing or orientation, or all lie at one position.
    """
    first = _usual(slices)
    for other in slices:
        if other.shape != first.shape:
            raise InputError(
                f"{other.path} is {_size(other)} but {first.path.name} is {_size(first)}; give one series of one size"
            )
        if not np.allclose(other.spacing, first.spacing, rtol=1e-3):
            raise InputError(f"{other.path} has another PixelSpacing than {first.path.name}; give one series")
        if np.abs([*(other.right - first.right), *(other.down - first.down)]).max() > 2e-3:
            raise InputError(
                f"{other.path} has another orientation than {first.path.name}; give one series of parallel slices"
            )
    positions = np.array([s.origin @ first.normal for s in slices])
    order = np.argsort(positions, kind="stable")
    if len(slices) > 1 and np.ptp(positions) < SAME_PLACE_MM:
        raise InputError(
            f"{folder}: all {len(slices)} slices lie at one position; they are no volume; give a series of slices"
        )
    return [slices[i] for i in order], positions[order]


def _usual(slices: Sequence[Slice]) -> Slice:
    """A slice like most of the others, so that a message names the odd one."""
    kinds = [(s.shape, np.round([*s.spacing, *s.right, *s.down], 2).tolist()) for s in slices]
    return slices[max(range(len(slices)), key=lambda index: kinds.count(kinds[index]))]


def stack(slices: Sequence[Slice], positions: FloatArray, folder: object) -> Stack:
    """The slices, sorted and each position once, as a stack.

    Raises InputError when there are too few, one is missing, gaps vary too much or the slices do not lie on one line.
    """
    if len(slices) < MIN_SLICES:
        raise InputError(
            f"{folder} holds {len(slices)} slices; at least {MIN_SLICES} are needed; give the whole series"
        )
    _refuse_interleaved(slices, folder)
    gaps = np.diff(positions)
    usual = float(np.median(gaps))
    _refuse_missing(slices, positions, usual)
    if gaps.max() > WIDEST_GAP * usual:
        at = int(np.argmax(gaps))
        raise InputError(
            f"{folder}: the gap between {slices[at].path.name} and {slices[at + 1].path.name} is {gaps[at]:.2f} mm where "
            f"{usual:.2f} mm is usual; up to {WIDEST_GAP:g} times is interpolated; give a reconstruction with even gaps"
        )
    count = np.arange(len(positions))
    even_gap, start = np.polyfit(count, positions, 1)
    even = bool(np.abs(positions - start - even_gap * count).max() <= max(EVEN_WITHIN_MM, 0.01 * even_gap))
    return Stack(tuple(slices), positions, _step(slices, positions), even, float(even_gap) if even else usual)


def _refuse_interleaved(slices: Sequence[Slice], folder: object) -> None:
    """Two acquisitions half a gap apart: the series' own counts of every second slice follow on each other, those of all do not."""
    counts = [s.instance for s in slices if s.instance is not None and s.is_hu]
    if len(counts) < max(len(slices), 2 * MIN_SLICES):
        return
    second = np.abs(np.array(counts[2:], dtype=float) - np.array(counts[:-2], dtype=float))
    if (second == 1.0).mean() > 0.5:
        raise InputError(
            f"{folder}: the slices are numbered as two acquisitions that lie in one another; give the slices of one of them"
        )


def _refuse_missing(slices: Sequence[Slice], positions: FloatArray, usual: float) -> None:
    gaps = np.diff(positions)
    for at in np.flatnonzero(gaps > WIDE_GAP * usual).tolist():
        if _row_of_like(gaps, at) >= COARSER_ROW and not _count_jumps(slices, at):
            continue
        raise InputError(
            f"a slice is missing between {slices[at].path} and {slices[at + 1].path.name}: {gaps[at]:.2f} mm apart at position "
            f"{positions[at]:.1f} mm where {usual:.2f} mm is usual; copy the whole series again"
        )


def _row_of_like(gaps: FloatArray, at: int) -> int:
    """How many gaps in a row, with the one at ``at``, are as wide as it."""
    like = np.abs(gaps - gaps[at]) < 0.1 * gaps[at]
    before, after = (sum(1 for _ in takewhile(bool, side)) for side in (like[at::-1], like[at:]))
    return before + after - 1


def _count_jumps(slices: Sequence[Slice], at: int) -> bool:
    """Whether the series' own count skips between a slice and the next although it does not elsewhere."""
    counts = [s.instance for s in slices]
    if any(count is None for count in counts):
        return False
    steps = np.abs(np.diff(np.array(counts, dtype=int)))
    return bool(steps[at] > np.median(steps))


def _step(slices: Sequence[Slice], positions: FloatArray) -> FloatArray:
    first, last = slices[0], slices[-1]
    step = (last.origin - first.origin) / (positions[-1] - positions[0])
    for each, position in zip(slices, positions, strict=True):
        aside = float(np.linalg.norm(each.origin - first.origin - (position - positions[0]) * step))
        if aside > 0.5 * min(first.spacing):
            raise InputError(
                f"{each.path} lies {aside:.1f} mm aside of the line of the other slices; give one series of one scan"
            )
    shifted = np.linalg.norm(step - first.normal) * (positions[-1] - positions[0])
    return first.normal if shifted < 0.1 * min(first.spacing) else step


def _size(one: Slice) -> str:
    return f"{one.shape[1]} x {one.shape[0]} pixels"
