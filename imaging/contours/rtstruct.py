"""DICOM RT structure sets: contoured organs as masks and labels on a CT's grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pydicom

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.imaging.contours.contours import contours_to_mask
from palpate.imaging.contours.named_labels import PAINT_ORDER, halves_beside_whole, note_on_whole
from palpate.imaging.contours.roi_names import choose_rois, distinct, unused_note
from palpate.imaging.dicom.files import read_file, reading
from palpate.imaging.dicom.same_scan import check_same_scan
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

_XOR = "CLOSEDPLANAR_XOR"
_CLOSED = ("CLOSED_PLANAR", _XOR)
# Types that are no area; DICOM PS3.3 C.8.8.6.3.
_NO_AREA = ("POINT", "OPEN_PLANAR", "OPEN_NONPLANAR")


@dataclass(eq=False)
class Contoured:
    """The closed contours (n, 3) mm of one structure, whether they are combined by exclusive or, and the images they were drawn on."""

    name: str
    number: int
    contours: list[FloatArray]
    exclusive: bool = False
    images: set[str] = field(default_factory=set)


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


def opened_rtstruct(path: Path) -> pydicom.Dataset:
    """The dataset of a structure set. Raises InputError naming the file when it is none."""
    if not path.is_file():
        raise InputError(f"{path} is not there; give the path of an RTSTRUCT file")
    dataset = read_file(path)
    if dataset is None or dataset.get("Modality") != "RTSTRUCT":
        raise InputError(f"{path} holds no contours: give an RTSTRUCT")
    return dataset


def read_rtstruct(
    path: Path | str, ct: Volume, facts: SeriesFacts | None = None, roi: Mapping[str, Sequence[str]] | None = None
) -> Structures:
    """The organs of a structure set on the grid of the CT it was drawn on.

    facts : the CT's, to check that the contours belong to it. roi : organ -> names of its structures, where the choice
    by name is not clear.

    Raises InputError naming the file: no structure set, of another scan, no organ, an unclear choice, bad contours.
    """
    path = Path(path)
    dataset = opened_rtstruct(path)
    notes: list[str] = []
    with reading(path):
        if facts is not None:
            notes += check_same_scan(dataset, _images(dataset), facts, path)
        rois = structures_in(dataset, path, notes)
        _leave_out_other_frames(dataset, rois, facts, notes)
    with_contours = {name: roi for name, roi in rois.items() if roi.contours}
    numbers = {name: roi.number for name, roi in rois.items()}
    _refuse_empty(rois, roi or {}, path)
    chosen, choice_notes = choose_rois(list(with_contours), str(path), roi, numbers, _types(dataset, rois))
    if not chosen:
        why = f" ({'; '.join(notes[:3])})" if notes else ""
        raise InputError(
            f"{path} holds no organ by name, only {', '.join(list(with_contours)[:20]) or 'nothing'}{why}; name them with --roi ORGAN=NAME"
        )
    notes += [*choice_notes, *unused_note(list(with_contours), chosen, choice_notes)]
    masks = {}
    try:
        for organ, names in chosen.items():
            masks[organ] = np.logical_or.reduce(
                [contours_to_mask(rois[name].contours, ct, name, notes, rois[name].exclusive) for name in names]
            )
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    if halves_beside_whole(chosen):
        notes += note_on_whole(masks["prostate"], masks["prostate_left"] | masks["prostate_right"])
        del masks["prostate"]
    return Structures(masks, chosen, tuple(notes))


def _leave_out_other_frames(
    dataset: pydicom.Dataset, rois: Mapping[str, Contoured], facts: SeriesFacts | None, notes: list[str]
) -> None:
    """A structure set may hold structures of several scans: those of another frame of reference lose their contours, with a note."""
    here = None if facts is None else facts.telling_frame_of_reference()
    if facts is None or here is None:
        return
    own = facts.telling_images()
    for item in dataset.get("StructureSetROISequence") or []:
        frame = str(item.get("ReferencedFrameOfReferenceUID") or "").strip()
        roi = next((roi for roi in rois.values() if roi.number == item.get("ROINumber")), None)
        if roi is not None and roi.contours and frame not in ("", here) and not roi.images & own:
            roi.contours.clear()
            notes.append(f"structure {roi.name} lies in another frame of reference than the CT and was left out")


def _refuse_empty(rois: Mapping[str, Contoured], wanted: Mapping[str, Sequence[str]], path: Path) -> None:
    for names in wanted.values():
        empty = [name for name in names if name in rois and not rois[name].contours]
        if empty:
            raise InputError(f"{path}: structure {empty[0]} has no closed contours; draw them or choose another")


def _types(dataset: pydicom.Dataset, rois: Mapping[str, Contoured]) -> dict[str, str]:
    """Name -> what the file says that a structure is (RTROIInterpretedType), where it says so."""
    by_number: dict[int, str] = {}
    for item in dataset.get("RTROIObservationsSequence") or []:
        number, kind = item.get("ReferencedROINumber"), str(item.get("RTROIInterpretedType") or "").strip().upper()
        if number is not None and kind:
            by_number[int(number)] = kind
    return {name: by_number[roi.number] for name, roi in rois.items() if roi.number in by_number}


def _images(dataset: pydicom.Dataset) -> set[str]:
    return {
        image
        for roi in dataset.get("ROIContourSequence") or []
        for contour in roi.get("ContourSequence") or []
        for image in _images_of(contour)
    }


def _images_of(contour: pydicom.Dataset) -> set[str]:
    return {str(image.get("ReferencedSOPInstanceUID", "")) for image in contour.get("ContourImageSequence") or []}


def structures_in(dataset: pydicom.Dataset, path: Path, notes: list[str]) -> dict[str, Contoured]:
    """The structures by name, each by the file's own number; what cannot be used is noted."""
    items = [item for item in dataset.get("StructureSetROISequence") or [] if item.get("ROINumber") is not None]
    numbers = [int(item.ROINumber) for item in items]
    names = distinct([" ".join(str(item.get("ROIName", "")).split()) for item in items], numbers)
    by_number: dict[int, Contoured] = {}
    for number, name in zip(numbers, names, strict=True):
        first = by_number.setdefault(number, Contoured(name, number, []))
        if first.name != name:
            notes.append(f"structure {name} has the number of {first.name}, {number}, and was left out")
    for item in dataset.get("ROIContourSequence") or []:
        number, contours = int(item.get("ReferencedROINumber", -1)), item.get("ContourSequence") or []
        if number in by_number:
            _add_contours(by_number[number], contours, path, notes)
        elif contours:
            notes.append(f"{len(contours)} contours of the structure number {number}, which has no name, were left out")
    notes += [f"structure {roi.name} has no contours" for roi in by_number.values() if not roi.contours]
    return {roi.name: roi for roi in by_number.values()}


def _add_contours(roi: Contoured, contours: Sequence[pydicom.Dataset], path: Path, notes: list[str]) -> None:
    unused: dict[str, int] = {}
    for contour in contours:
        points, kind = _points(contour, roi.name, path), str(contour.get("ContourGeometricType") or "").strip().upper()
        if kind in _CLOSED and len(points) >= 3:
            roi.contours.append(points)
            roi.exclusive |= kind == _XOR
            roi.images |= _images_of(contour)
        elif len(points) > 1 or kind not in (*_CLOSED, *_NO_AREA):
            unused[kind] = unused.get(kind, 0) + 1
    for kind, count in unused.items():
        shown = "".join(c for c in kind if c.isprintable())[:32] or "none"
        what = "closed" if kind in (*_CLOSED, *_NO_AREA) else f"of a known type (ContourGeometricType is {shown})"
        a = "a contour that is" if count == 1 else f"{count} contours that are"
        notes.append(f"structure {roi.name} has {a} not {what}; left out")


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
