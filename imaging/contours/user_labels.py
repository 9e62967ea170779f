"""Labels that a person drew on a scan, from whatever program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from palpate.core.errors import InputError
from palpate.imaging.contours.detached_parts import detached_notes
from palpate.imaging.contours.dicom_seg import images_of, read_dicom_seg
from palpate.imaging.contours.itksnap_labels import read_label_names
from palpate.imaging.contours.itksnap_workspace import LABEL_LAYER, read_workspace
from palpate.imaging.contours.named_labels import Segments, is_split, labels_of
from palpate.imaging.contours.nifti_labels import names_within, read_numbers, with_meaning
from palpate.imaging.contours.numbered_labels import meaning_of_names, meaning_of_numbers
from palpate.imaging.contours.rtstruct import read_rtstruct
from palpate.imaging.contours.seg_nrrd import read_seg_nrrd
from palpate.imaging.dicom.files import read_file, reading
from palpate.imaging.dicom.same_scan import check_same_scan
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.labels import LABELS, ORGAN_LABELS
from palpate.imaging.volume import Volume

# The label description file of ITK-SNAP that speaks for the volumes beside it.
DESCRIPTION = "labels.txt"
_NIFTI = (".nii", ".nii.gz")


@dataclass(frozen=True, eq=False)
class UserLabels:
    """volume : labels in the scan's frame. source : "nifti", "itksnap", "seg.nrrd", "dicom-seg" or "rtstruct".

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


def read_user_labels(
    path: Path | str,
    ct: Volume,
    facts: SeriesFacts | None = None,
    roi: Mapping[str, Sequence[str]] | None = None,
    placed: bool = True,
) -> UserLabels:
    """The labels drawn on a CT: NIfTI, ITK-SNAP workspace, 3D Slicer's .seg.nrrd, DICOM RTSTRUCT or SEG.

    roi : organ -> names or numbers of its structures in the file, where names do not tell. placed : check that the labels
    lie where the CT is; False for whoever moves them first and checks then (`lying_in`).

    Raises InputError naming the file when it cannot be read or lies elsewhere.
    """
    labels = _with_parts(_read(Path(path), ct, facts, roi))
    return lying_in(labels, ct, Path(path)) if placed and labels.source != "rtstruct" else labels


def _with_parts(labels: UserLabels) -> UserLabels:
    return replace(labels, notes=(*labels.notes, *detached_notes(labels.volume)))


def _read(path: Path, ct: Volume, facts: SeriesFacts | None, roi: Mapping[str, Sequence[str]] | None) -> UserLabels:
    name = path.name.lower()
    if name.endswith(_NIFTI):
        return _of_nifti(path, roi)
    if name.endswith(".itksnap"):
        return _of_workspace(path, roi)
    if name.endswith(".nrrd"):
        return _of_segments(read_seg_nrrd(path), "seg.nrrd", path, roi)
    if is_segmentation(path):
        segments = read_dicom_seg(path)
        unchecked: list[str] = []
        if facts is not None:
            with reading(path):
                unchecked = check_same_scan(segments.origin, images_of(segments.origin), facts, path)
        labels = _of_segments(segments, "dicom-seg", path, roi)
        return replace(labels, notes=(*unchecked, *labels.notes))
    structures = read_rtstruct(path, ct, facts, roi)
    return UserLabels(
        structures.labels(ct), "rtstruct", structures.prostate_is_split, structures.names, structures.notes
    )


def files_of(path: Path) -> list[Path]:
    """The files that a person's labels are read from: a workspace names its volume, a labels.txt beside a volume its values.

    Raises InputError when a workspace cannot be read.
    """
    if path.name.lower().endswith(".itksnap") and path.is_file():
        return [path, read_workspace(path).only(LABEL_LAYER, str(path)).path]
    description = path.parent / DESCRIPTION
    return [path, description] if path.name.lower().endswith(_NIFTI) and description.is_file() else [path]


def is_segmentation(path: Path) -> bool:
    """Whether the file is a DICOM segmentation."""
    header = read_file(path, stop_before_pixels=True) if path.is_file() else None
    return header is not None and header.get("Modality") == "SEG"


def read_label_volume(path: Path, roi: Mapping[str, Sequence[str]] | None = None) -> UserLabels:
    """A NIfTI label volume by the names of the labels.txt beside it or within it, by the caller's choice, or by the numbers of LABELS.

    roi : organ -> names of that file, or the volume's own numbers. Raises InputError naming the file.
    """
    return _with_parts(_of_nifti(path, roi))


def _of_nifti(path: Path, roi: Mapping[str, Sequence[str]] | None) -> UserLabels:
    description = path.parent / DESCRIPTION
    if description.is_file():
        return _of_volume(path, read_label_names(description), str(description), "nifti", roi)
    return _of_volume(path, names_within(path), str(path), "nifti", roi)


def _of_volume(
    path: Path, names: Mapping[int, str], source: str, kind: str, roi: Mapping[str, Sequence[str]] | None
) -> UserLabels:
    """names : value -> name, empty where nothing names them; source : the file that does."""
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


def _of_segments(segments: Segments, source: str, path: Path, roi: Mapping[str, Sequence[str]] | None) -> UserLabels:
    volume, chosen, notes = labels_of(segments, str(path), roi)
    return UserLabels(volume, source, is_split(chosen), chosen, tuple(notes))


def _of_workspace(path: Path, roi: Mapping[str, Sequence[str]] | None) -> UserLabels:
    workspace = read_workspace(path)
    layer = workspace.only(LABEL_LAYER, str(path))
    if not layer.path.name.lower().endswith(_NIFTI):
        raise InputError(
            f"{path} names {layer.path.name} as its segmentation; save that as NIfTI (.nii.gz) in ITK-SNAP"
        )
    return _of_volume(layer.path, workspace.names, str(path), "itksnap", roi)


def lying_in(labels: UserLabels, ct: Volume, path: Path) -> UserLabels:
    """The labels. Raises InputError naming the file where most of them lie outside the CT."""
    volume = labels.volume
    points = volume.to_lps(np.argwhere(volume.array > 0).astype(float))
    index = ct.to_index(points)
    inside = np.all((index >= -0.5) & (index <= np.array(ct.array.shape) - 0.5), axis=1).mean()
    if inside < 0.5:
        raise InputError(
            f"{path}: {100 * (1 - inside):.0f} % of the labels lie outside the CT; give the labels drawn on this scan"
        )
    return labels
