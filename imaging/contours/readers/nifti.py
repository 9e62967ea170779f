"""NIfTI label volumes, named by a labels.txt beside them or by their own header."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from palpate.imaging.contours.itksnap_labels import read_label_names
from palpate.imaging.contours.label_reader import LabelReader, Roi, StructureEntry, UserLabels
from palpate.imaging.contours.nifti_labels import NIFTI, names_within, read_numbers, with_meaning
from palpate.imaging.contours.numbered_labels import meaning_of_names, meaning_of_numbers
from palpate.imaging.contours.structure_names import organ_of
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.labels import LABELS, ORGAN_LABELS
from palpate.imaging.volume import Volume

# The label description file of ITK-SNAP that speaks for the volumes beside it.
DESCRIPTION = "labels.txt"
_SOURCE = "nifti"
_CUBIC_MM = 1000.0


def read_volume(path: Path, roi: Roi = None) -> UserLabels:
    """The labels of a volume by itself. roi : organ -> names, or the volume's own numbers. Raises InputError naming the file."""
    names, source = _names(path)
    return numbers_as_labels(path, names, source, _SOURCE, roi)


def numbers_as_labels(path: Path, names: Mapping[int, str], source: str, kind: str, roi: Roi) -> UserLabels:
    """The labels of a volume. names : value -> name, empty where nothing names them; source : the file that does.
    kind : source of the labels. Raises InputError naming the file."""
    numbers = read_numbers(path)
    present = [int(value) for value in np.unique(numbers.array)]
    meaning = (meaning_of_names(names, source, roi) if names else meaning_of_numbers(str(path), roi)).keeping(present)
    volume = with_meaning(numbers, meaning.values, path)
    notes = meaning.notes
    halves = [value for value in present if meaning.values.get(value) in ORGAN_LABELS]
    if not meaning.is_whole and len({meaning.values[value] for value in halves}) == 1:
        named = f" ({names[halves[0]].strip()})" if names.get(halves[0]) else ""
        own = ",".join(str(value) for value in halves)
        notes += (
            f"label {own}{named} is the only one of the prostate: it is taken as one region; to have it divided into left and right, "
            f"give --roi prostate={own}",
        )
    structures = meaning.chosen if names or roi else {}
    return UserLabels(volume, kind, not meaning.is_whole, structures, notes)


def numbers_as_structures(path: Path, names: Mapping[int, str]) -> list[StructureEntry]:
    """The numbers of a volume as structures. names : value -> name. Raises InputError naming the file."""
    volume = read_numbers(path)
    values, counts = np.unique(volume.array[volume.array > 0], return_counts=True)
    voxel = float(np.prod(volume.spacing)) / _CUBIC_MM
    out = []
    for value, count in zip(values.tolist(), counts.tolist(), strict=True):
        name = names.get(value, "").strip()
        organ = organ_of(name) if name else LABELS.get(value)
        out.append(StructureEntry(str(int(value)), name or f"label {int(value)}", count * voxel, organ or ""))
    return out


def _names(path: Path) -> tuple[Mapping[int, str], str]:
    """Value -> name, and the file that says so."""
    description = path.parent / DESCRIPTION
    return (
        (read_label_names(description), str(description)) if description.is_file() else (names_within(path), str(path))
    )


def _read(path: Path, ct: Volume, facts: SeriesFacts | None, roi: Roi) -> UserLabels:
    return read_volume(path, roi)


def _files(path: Path) -> list[Path]:
    description = path.parent / DESCRIPTION
    return [path, description] if description.is_file() else [path]


READER = LabelReader(
    _SOURCE, "NIfTI", _read, lambda path: numbers_as_structures(path, _names(path)[0]), NIFTI, holds_voxels=True,
    files=_files,
)  # fmt: skip
