"""Labels that a person drew on a scan, from whatever program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.core.errors import InputError
from palpate.imaging.contours.dicom_seg import images_of, read_dicom_seg
from palpate.imaging.contours.itksnap_labels import label_values, meaning_of
from palpate.imaging.contours.itksnap_workspace import LABEL_LAYER, read_workspace
from palpate.imaging.contours.named_labels import Segments, is_split, labels_of
from palpate.imaging.contours.nifti_labels import read_labels
from palpate.imaging.contours.rtstruct import read_rtstruct
from palpate.imaging.contours.seg_nrrd import read_seg_nrrd
from palpate.imaging.dicom.files import read_file, reading
from palpate.imaging.dicom.same_scan import check_same_scan
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.labels import LABEL_VALUES, LABELS, ORGAN_LABELS
from palpate.imaging.volume import Volume


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

    def to_dict(self) -> dict[str, Any]:
        """What user_labels.json says of one state."""
        present = [LABELS[int(value)] for value in np.unique(self.volume.array) if value]
        return {
            "source": self.source,
            "labels": present,
            "prostate_is_split": self.prostate_is_split,
            "structures": {organ: list(names) for organ, names in self.structures.items()},
        }


def read_user_labels(
    path: Path | str, ct: Volume, facts: SeriesFacts | None = None, roi: Mapping[str, Sequence[str]] | None = None
) -> UserLabels:
    """The labels drawn on a CT: NIfTI, ITK-SNAP workspace, 3D Slicer's .seg.nrrd, DICOM RTSTRUCT or SEG.

    Raises InputError naming the file when it cannot be read or lies elsewhere.
    """
    path = Path(path)
    name = path.name.lower()
    if name.endswith((".nii", ".nii.gz")):
        return _inside(_of_nifti(path, roi), ct, path)
    if name.endswith(".itksnap"):
        return _inside(_of_workspace(path), ct, path)
    if name.endswith(".nrrd"):
        return _inside(_of_segments(read_seg_nrrd(path), "seg.nrrd", path, roi), ct, path)
    if is_segmentation(path):
        segments = read_dicom_seg(path)
        if facts is not None:
            with reading(path):
                check_same_scan(segments.dataset, images_of(segments.dataset), facts, path)
        return _inside(_of_segments(segments, "dicom-seg", path, roi), ct, path)
    structures = read_rtstruct(path, ct, facts, roi)
    return UserLabels(
        structures.labels(ct), "rtstruct", structures.prostate_is_split, structures.names, structures.notes
    )


def files_of(path: Path) -> list[Path]:
    """The files that a person's labels lie in: a workspace names others. Raises InputError when it cannot be read."""
    if path.name.lower().endswith(".itksnap") and path.is_file():
        return [path, read_workspace(path).only(LABEL_LAYER, str(path)).path]
    return [path]


def is_segmentation(path: Path) -> bool:
    """Whether the file is a DICOM segmentation."""
    header = read_file(path, stop_before_pixels=True) if path.is_file() else None
    return header is not None and header.get("Modality") == "SEG"


def _of_nifti(path: Path, roi: Mapping[str, Sequence[str]] | None) -> UserLabels:
    """roi : organ -> the file's own numbers; without it they are those of `LABELS`, or of the labels.txt beside the file."""
    if roi:
        return UserLabels(read_labels(path, _numbered(path, roi)), "nifti", "prostate" not in roi, dict(roi), ())
    description = path.parent / "labels.txt"
    volume = read_labels(path, label_values(description) if description.is_file() else None)
    present = set(np.unique(volume.array).tolist()) & set(ORGAN_LABELS)
    notes: tuple[str, ...] = ()
    if len(present) == 1:
        value = present.pop()
        notes = (
            f"label {value} is the only one of the prostate: it is taken as one region; to have it divided into left and right, give "
            f"--roi prostate={value}",
        )
    return UserLabels(volume, "nifti", True, {}, notes)


def _numbered(path: Path, roi: Mapping[str, Sequence[str]]) -> dict[int, int]:
    """The file's value -> value of LABELS, for organs given by number."""
    values = {**LABEL_VALUES, "prostate": ORGAN_LABELS[0]}
    out = {value: value for value in LABELS}
    for organ, numbers in roi.items():
        if organ not in values or not all(number.strip().isdigit() for number in numbers):
            raise InputError(
                f"{path} has numbers, not names: give --roi ORGAN=NUMBER with ORGAN one of {', '.join(sorted(values))}"
            )
        out.update({int(number): values[organ] for number in numbers})
    return out


def _of_segments(segments: Segments, source: str, path: Path, roi: Mapping[str, Sequence[str]] | None) -> UserLabels:
    volume, chosen, notes = labels_of(segments, str(path), roi)
    return UserLabels(volume, source, is_split(chosen), chosen, tuple(notes))


def _of_workspace(path: Path) -> UserLabels:
    workspace = read_workspace(path)
    layer = workspace.only(LABEL_LAYER, str(path))
    if not layer.path.name.lower().endswith((".nii", ".nii.gz")):
        raise InputError(
            f"{path} names {layer.path.name} as its segmentation; save that as NIfTI (.nii.gz) in ITK-SNAP"
        )
    values = meaning_of(workspace.names, str(path)) if workspace.names else None
    return UserLabels(read_labels(layer.path, values), "itksnap", True, {}, ())


def _inside(labels: UserLabels, ct: Volume, path: Path) -> UserLabels:
    """The labels, once it is sure that they lie where the CT is."""
    volume = labels.volume
    points = volume.to_lps(np.argwhere(volume.array > 0).astype(float))
    index = ct.to_index(points)
    inside = np.all((index >= -0.5) & (index <= np.array(ct.array.shape) - 0.5), axis=1).mean()
    if inside < 0.5:
        raise InputError(
            f"{path}: {100 * (1 - inside):.0f} % of the labels lie outside the CT; give the labels drawn on this scan"
        )
    return labels
