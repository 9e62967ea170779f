"""Label volumes: whole numbers on a grid, named by a labels.txt beside them or by their own header, else by the numbers of LABELS."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import SimpleITK as sitk

from palpate.imaging.contours.itksnap_labels import read_label_names
from palpate.imaging.contours.label_reader import Roi, StructureEntry, UserLabels
from palpate.imaging.contours.metaimage import METAIMAGE, read_metaimage
from palpate.imaging.contours.nifti_labels import NIFTI, names_within, read_numbers, whole_numbers, with_meaning
from palpate.imaging.contours.nrrd import read_nrrd
from palpate.imaging.contours.numbered_labels import meaning_of_names, meaning_of_numbers
from palpate.imaging.contours.structure_names import organ_of
from palpate.imaging.labels import LABELS, ORGAN_LABELS
from palpate.imaging.volume import Volume

# The label description file of ITK-SNAP that speaks for the volumes beside it.
DESCRIPTION = "labels.txt"
_CUBIC_MM = 1000.0


@dataclass(frozen=True, eq=False)
class NumberedVolume:
    """path : of the file. volume : its whole numbers, on its own grid. notes : what was done, one line each."""

    path: Path
    volume: Volume
    notes: tuple[str, ...] = ()


def numbered(path: Path) -> NumberedVolume:
    """The numbers of a NIfTI, NRRD or MetaImage file. Raises InputError naming the file where they are not whole, or it is damaged."""
    if path.name.lower().endswith(NIFTI):
        return NumberedVolume(path, read_numbers(path))
    if path.name.lower().endswith(METAIMAGE):
        meta = read_metaimage(path)
        return NumberedVolume(path, Volume(whole_numbers(meta.array, path), meta.affine))
    found = read_nrrd(path)
    array = np.transpose(sitk.GetArrayFromImage(found.image))
    return NumberedVolume(path, Volume(whole_numbers(array, path), found.affine), found.notes)


def read_volume(path: Path, kind: str, roi: Roi = None) -> UserLabels:
    """The labels of a volume by itself. kind : source of the labels. roi : organ -> names, or the volume's own numbers.

    Raises InputError naming the file.
    """
    names, source = names_of(path)
    return numbers_as_labels(numbered(path), names, source, kind, roi)


def structures_of(path: Path) -> list[StructureEntry]:
    """The numbers of a volume by itself as structures. Raises InputError naming the file."""
    return numbers_as_structures(numbered(path), names_of(path)[0])


def names_of(path: Path) -> tuple[Mapping[int, str], str]:
    """Value -> name, and the file that says so. Raises InputError naming the file."""
    description = path.parent / DESCRIPTION
    if description.is_file():
        return read_label_names(description), str(description)
    return (names_within(path) if path.name.lower().endswith(NIFTI) else {}), str(path)


def with_description(path: Path) -> list[Path]:
    """The file, and the one beside it that names its values."""
    description = path.parent / DESCRIPTION
    return [path, description] if description.is_file() else [path]


def numbers_as_labels(
    numbers: NumberedVolume, names: Mapping[int, str], source: str, kind: str, roi: Roi
) -> UserLabels:
    """The labels of a volume. names : value -> name, empty where nothing names them; source : the file that does.
    kind : source of the labels. Raises InputError naming the file."""
    path = numbers.path
    present = [int(value) for value in np.unique(numbers.volume.array)]
    meaning = (meaning_of_names(names, source, roi) if names else meaning_of_numbers(str(path), roi)).keeping(present)
    volume = with_meaning(numbers.volume, meaning.values, path)
    notes = (*numbers.notes, *meaning.notes)
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


def numbers_as_structures(numbers: NumberedVolume, names: Mapping[int, str]) -> list[StructureEntry]:
    """The numbers of a volume as structures. names : value -> name."""
    volume = numbers.volume
    values, counts = np.unique(volume.array[volume.array > 0], return_counts=True)
    voxel = float(np.prod(volume.spacing)) / _CUBIC_MM
    out = []
    for value, count in zip(values.tolist(), counts.tolist(), strict=True):
        name = names.get(value, "").strip()
        organ = organ_of(name) if name else LABELS.get(value)
        out.append(StructureEntry(str(int(value)), name or f"label {int(value)}", count * voxel, organ or ""))
    return out
