"""What a reader of labels is, and what it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.labels import LABELS
from palpate.imaging.volume import Volume

# Organ -> names or numbers of its structures in a file, where their names do not tell.
Roi = Mapping[str, Sequence[str]] | None


@dataclass(frozen=True, eq=False)
class UserLabels:
    """volume : labels in the scan's frame. source : of the reader.

    prostate_is_split : False where value 1 stands for the whole prostate, left and right yet to be told apart.
    structures : organ -> names of the structures or segments it was made of.
    """

    volume: Volume
    source: str
    prostate_is_split: bool
    structures: Mapping[str, Sequence[str]]
    notes: tuple[str, ...]

    def to_dict(self) -> dict[str, object]:
        """What user_labels.json says of one state."""
        present = [LABELS[int(value)] for value in np.unique(self.volume.array) if value]
        return {
            "source": self.source,
            "labels": present,
            "prostate_is_split": self.prostate_is_split,
            "structures": {organ: list(names) for organ, names in self.structures.items()},
        }


@dataclass(frozen=True)
class StructureEntry:
    """One structure. identifier : as `--roi` takes it. organ : that its name stands for; "" for none that is known."""

    identifier: str
    name: str
    volume_cc: float
    organ: str


def the_file_alone(path: Path) -> list[Path]:
    """The files that are read of most forms."""
    return [path]


@dataclass(frozen=True)
class LabelReader:
    """A form in which labels come. Each file of `imaging/contours/readers` defines one as READER.

    source : its name in user_labels.json. words : its name in messages. suffixes : endings of its files, in lower case.
    modality : of its DICOM objects, whose files no ending tells apart. holds_voxels : the labels are voxels in a file that
    names no frame of reference, so that their grid alone tells in which frame they were drawn.
    read : (path, CT, facts of the CT, roi) -> labels; structures : path -> the structures that are not empty; both raise
    InputError naming the file. files : path -> all files that are read with it.
    """

    source: str
    words: str
    read: Callable[[Path, Volume, SeriesFacts | None, Roi], UserLabels]
    structures: Callable[[Path], list[StructureEntry]]
    suffixes: tuple[str, ...] = ()
    modality: str = ""
    holds_voxels: bool = False
    files: Callable[[Path], list[Path]] = the_file_alone
