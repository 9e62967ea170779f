"""Label volumes from files that hold segments by name: DICOM SEG, 3D Slicer's .seg.nrrd."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from palpate.core.arrays import BoolArray
from palpate.core.errors import InputError
from palpate.imaging.contours.roi_names import choose_rois
from palpate.imaging.labels import (
    BLADDER,
    BONE,
    LABEL_VALUES,
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


class Segments(Protocol):
    """What a reader gives. names : of the segments, each once. grid : an empty uint8 volume on which they lie."""

    @property
    def names(self) -> Sequence[str]: ...

    @property
    def grid(self) -> Volume: ...

    def mask(self, name: str) -> BoolArray:
        """The voxels of a segment, shape of the grid's array."""
        ...


def label_named(name: str) -> str | None:
    """The label that a name is, whatever its case, blanks and dashes; None when it is none."""
    key = re.sub(r"[\s-]+", "_", name.strip().lower())
    return key if LABEL_VALUES.get(key) else None


def labels_of(
    segments: Segments, source: str, wanted: Mapping[str, Sequence[str]] | None = None
) -> tuple[Volume, dict[str, list[str]], list[str]]:
    """The label volume (uint8) of named segments, organ -> the names it was made of, and notes.

    Names that are those of LABELS are taken as they are, unless the caller chose; else organs are told by their names
    in several languages. A prostate that is not split has the value of its left part throughout.

    Raises InputError naming the file when no segment is an organ, the choice is not clear, or all are empty.
    """
    exact = {name: label for name in segments.names if (label := label_named(name)) is not None}
    chosen: dict[str, list[str]] = {}
    notes: list[str] = []
    if exact and not wanted:
        for name, label in exact.items():
            chosen.setdefault(label, []).append(name)
        unused = [name for name in segments.names if name not in exact]
        notes += [f"segments not used: {', '.join(unused[:20])}"] if unused else []
    else:
        chosen, notes = choose_rois(segments.names, source, wanted)
    if not chosen:
        found = ", ".join(segments.names[:20]) or "nothing"
        raise InputError(f"{source} holds no organ by name, only {found}; name them with --roi ORGAN=NAME")
    array = np.zeros(segments.grid.array.shape, dtype=np.uint8)
    for organ, value in PAINT_ORDER.items():
        for name in chosen.get(organ, ()):
            array[segments.mask(name)] = value
    if not array.any():
        raise InputError(f"{source}: the segments of {', '.join(chosen)} are empty; save the segmentation again")
    return segments.grid.with_array(array), chosen, notes


def unique(names: Sequence[str]) -> list[str]:
    """The names, with a count after those that came before."""
    seen: dict[str, int] = {}
    found = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        found.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return found


def is_split(chosen: Mapping[str, Sequence[str]]) -> bool:
    """Whether left and right prostate are told apart."""
    return all(LABELS[value] in chosen for value in (PROSTATE_LEFT, PROSTATE_RIGHT))
