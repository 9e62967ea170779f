"""DICOM RT structure sets: contoured organs as masks and labels on a CT's grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pydicom

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.imaging.contours.contours import contours_to_mask
from palpate.imaging.contours.named_labels import PAINT_ORDER
from palpate.imaging.contours.roi_names import choose_rois
from palpate.imaging.dicom.files import read_file, reading
from palpate.imaging.dicom.same_scan import check_same_scan
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

# Contours of one slice are combined by exclusive or, whatever the newer of the two names says.
_CLOSED = ("CLOSED_PLANAR", "CLOSEDPLANAR_XOR")


@dataclass(frozen=True, eq=False)
class Structures:
    """Organs of a structure set on a CT's grid.

    masks : organ (prostate, prostate_left, prostate_right, bladder, rectum, bone) -> bool array of the CT's shape.
    names : organ -> the structures it was made of. notes : what a person should know, one line each.
    """

    masks: dict[str, BoolArray]
    names: dict[str, list[str]]
    notes: tuple[str, ...]

    @property
    def prostate_is_split(self) -> bool:
        """Whether left and right prostate were contoured by themselves."""
        return "prostate_left" in self.masks and "prostate_right" in self.masks

    def labels(self, grid: Volume) -> Volume:
        """The label volume; a prostate that is not split has the value of its left part throughout."""
        array = np.zeros(grid.array.shape, dtype=np.uint8)
        for organ, value in PAINT_ORDER.items():
            if organ in self.masks:
                array[self.masks[organ]] = value
        return grid.with_array(array)


def is_rtstruct(path: Path) -> bool:
    """Whether the file is a DICOM RT structure set."""
    header = read_file(path, stop_before_pixels=True)
    return header is not None and header.get("Modality") == "RTSTRUCT"


def read_rtstruct(
    path: Path | str, ct: Volume, facts: SeriesFacts | None = None, roi: Mapping[str, Sequence[str]] | None = None
) -> Structures:
    """The organs of a structure set on the grid of the CT it was drawn on.

    facts : the CT's, to check that the contours belong to it. roi : organ -> names of its structures, where the choice
    by name is not clear.

    Raises InputError naming the file: no structure set, of another scan, no organ, an unclear choice, bad contours.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path} is not there; give the path of an RTSTRUCT file")
    dataset = read_file(path)
    if dataset is None or dataset.get("Modality") != "RTSTRUCT":
        raise InputError(
            f"{path} holds no contours: give an RTSTRUCT, DICOM SEG, NIfTI, ITK-SNAP workspace or .seg.nrrd"
        )
    with reading(path):
        if facts is not None:
            check_same_scan(dataset, _images(dataset), facts, path)
        contours, notes = _contours(dataset, path)
    chosen, choice_notes = choose_rois(list(contours), str(path), roi)
    if not chosen:
        raise InputError(
            f"{path} holds no organ by name, only {', '.join(contours) or 'nothing'}; name them with --roi ORGAN=NAME"
        )
    notes += choice_notes
    masks = {}
    try:
        for organ, names in chosen.items():
            masks[organ] = np.logical_or.reduce([contours_to_mask(contours[name], ct, name, notes) for name in names])
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return Structures(masks, chosen, tuple(notes))


def _images(dataset: pydicom.Dataset) -> set[str]:
    return {
        str(image.get("ReferencedSOPInstanceUID", ""))
        for roi in dataset.get("ROIContourSequence") or []
        for contour in roi.get("ContourSequence") or []
        for image in contour.get("ContourImageSequence") or []
    }


def _contours(dataset: pydicom.Dataset, path: Path) -> tuple[dict[str, list[FloatArray]], list[str]]:
    """The closed contours of each structure that has any, name -> [(n, 3) mm]."""
    names = {
        int(s.ROINumber): " ".join(str(s.get("ROIName", "")).split())
        for s in dataset.get("StructureSetROISequence") or []
    }
    found: dict[str, list[FloatArray]] = {}
    notes: list[str] = []
    for roi in dataset.get("ROIContourSequence") or []:
        name = names.get(int(roi.get("ReferencedROINumber", -1)), "")
        for contour in roi.get("ContourSequence") or []:
            points = _points(contour, name, path)
            if str(contour.get("ContourGeometricType", "")) in _CLOSED and len(points) >= 3:
                found.setdefault(name, []).append(points)
            elif name and len(points) > 1:
                notes.append(f"structure {name} has a contour that is not closed; it was left out")
    return found, list(dict.fromkeys(notes))


def _points(contour: pydicom.Dataset, name: str, path: Path) -> FloatArray:
    try:
        points = np.array(contour.get("ContourData") or [], dtype=np.float64).reshape(-1, 3)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{path}: a contour of structure {name} is no list of points; export the structures again"
        ) from error
    if not np.isfinite(points).all():
        raise InputError(
            f"{path}: a contour of structure {name} has points that are not finite; export the structures again"
        )
    return points
