"""Label volumes from files that hold segments by name: DICOM SEG, 3D Slicer's .seg.nrrd."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from palpate.core.arrays import BoolArray
from palpate.core.errors import InputError
from palpate.imaging.contours.label_reader import Roi, StructureEntry, UserLabels
from palpate.imaging.contours.roi_names import choose_rois, unused_note
from palpate.imaging.contours.structure_names import organ_of
from palpate.imaging.labels import (
    BLADDER,
    BONE,
    LABELS,
    PROSTATE_LEFT,
    PROSTATE_RIGHT,
    RECTUM,
    SURROUNDING_TISSUE,
)
from palpate.imaging.volume import Volume

# Organ -> label value. Where segments overlap the later one wins: organs matter more than what is around them.
PAINT_ORDER = {
    "surrounding_tissue": SURROUNDING_TISSUE,
    "bone": BONE,
    "bladder": BLADDER,
    "rectum": RECTUM,
    "prostate": PROSTATE_LEFT,
    "prostate_left": PROSTATE_LEFT,
    "prostate_right": PROSTATE_RIGHT,
}
# Share of the prostate by which the whole one and its halves may differ without a note: rounding of outlines.
_SAME_PROSTATE = 0.02
_CUBIC_MM = 1000.0
# Organs that reach from their first slice to their last.
ONE_PIECE = ("prostate", "prostate_left", "prostate_right", "bladder", "rectum")


class Segments(Protocol):
    """What a reader gives. names : of the segments, each once. grid : an empty uint8 volume on which they lie.

    numbers : name -> the file's own number of it. notes : what was found odd in reading, one line each.
    """

    @property
    def names(self) -> Sequence[str]: ...

    @property
    def numbers(self) -> Mapping[str, int]: ...

    @property
    def notes(self) -> Sequence[str]: ...

    @property
    def grid(self) -> Volume: ...

    def mask(self, name: str) -> BoolArray:
        """The voxels of a segment, shape of the grid's array."""
        ...


def labels_of(
    segments: Segments, source: str, wanted: Mapping[str, Sequence[str]] | None = None
) -> tuple[Volume, dict[str, list[str]], list[str]]:
    """The label volume (uint8) of named segments, organ -> the names it was made of, and notes.

    Organs are told by their names, see ``roi_names``. A prostate that is not split has the value of its left part throughout.

    Raises InputError naming the file when no segment is an organ, the choice is not clear, or all are empty.
    """
    chosen, chosen_notes = choose_rois(segments.names, source, wanted, segments.numbers)
    if not chosen:
        found = ", ".join(segments.names[:20]) or "nothing"
        raise InputError(f"{source} holds no organ by name, only {found}; name them with --roi ORGAN=NAME")
    notes = [*segments.notes, *chosen_notes, *unused_note(segments.names, chosen, chosen_notes)]
    if halves_beside_whole(chosen):
        parts = {o: _union(segments, chosen[o]) for o in ("prostate", "prostate_left", "prostate_right")}
        notes += note_on_whole(parts["prostate"], parts["prostate_left"] | parts["prostate_right"])
        chosen = {organ: names for organ, names in chosen.items() if organ != "prostate"}
    array = np.zeros(segments.grid.array.shape, dtype=np.uint8)
    for organ, value in PAINT_ORDER.items():
        for name in chosen.get(organ, ()):
            mask = segments.mask(name)
            notes += _gaps(mask, name) if organ in ONE_PIECE else []
            array[mask] = value
    if not array.any():
        raise InputError(f"{source}: the segments of {', '.join(chosen)} are empty; save the segmentation again")
    return segments.grid.with_array(array), chosen, notes


def segments_as_labels(segments: Segments, source: str, path: Path, roi: Roi) -> UserLabels:
    """The labels of a file's segments. source : of its reader. Raises InputError as `labels_of`."""
    volume, chosen, notes = labels_of(segments, str(path), roi)
    return UserLabels(volume, source, is_split(chosen), chosen, tuple(notes))


def segments_as_structures(segments: Segments) -> list[StructureEntry]:
    """The segments that are not empty."""
    voxel = float(np.prod(segments.grid.spacing)) / _CUBIC_MM
    counts = {name: int(segments.mask(name).sum()) for name in segments.names}
    return [StructureEntry(name, name, n * voxel, organ_of(name) or "") for name, n in counts.items() if n]


def halves_beside_whole(chosen: Mapping[str, Sequence[str]]) -> bool:
    """Whether a file has the whole prostate beside both of its halves. The halves are taken: they tell the side."""
    return "prostate" in chosen and is_split(chosen)


def note_on_whole(whole: BoolArray, halves: BoolArray) -> list[str]:
    """A note where a whole prostate and its halves, masks of one grid, are not the same."""
    apart = int((halves ^ whole).sum()) / max(int(halves.sum()), 1)
    if apart <= _SAME_PROSTATE:
        return []
    return [
        f"the whole prostate and its halves differ by {100 * apart:.0f} % of the volume; the halves were taken: delete them "
        "from the file where the whole one is right"
    ]


def _union(segments: Segments, names: Sequence[str]) -> BoolArray:
    return np.logical_or.reduce([segments.mask(name) for name in names])


def _gaps(mask: BoolArray, name: str) -> list[str]:
    """Notes on a segment that is empty, or on some slices between its first and last."""
    filled = np.flatnonzero(mask.any(axis=(0, 1)))
    if len(filled) == 0:
        return [f"segment {name} is empty"]
    missing = int(filled[-1] - filled[0] + 1 - len(filled))
    return [f"segment {name} is empty on {missing} slices between its first and its last"] if missing else []


def is_split(chosen: Mapping[str, Sequence[str]]) -> bool:
    """Whether left and right prostate are told apart."""
    return all(LABELS[value] in chosen for value in (PROSTATE_LEFT, PROSTATE_RIGHT))
