"""DICOM Spatial Registrations: the rigid motion between the frames of reference of two scans.

Each item of the RegistrationSequence has a frame of reference, or images, and the matrix that brings its points into the
registration's own frame (DICOM PS3.3 C.20.2): systems write the identity for the fixed scan and one matrix for the moving one.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pydicom
from pydicom.uid import DeformableSpatialRegistrationStorage

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.dicom.files import read_file, reading
from palpate.imaging.dicom.series import REGISTRATION, SeriesFacts

# Matrices that differ by less than this, in their rotation and in mm, are one.
_SAME = 1e-3
# Files beside a scan's folder that are looked at.
_MOST_FILES = 100


def read_registration(path: Path, rest: SeriesFacts, deformed: SeriesFacts) -> FloatArray:
    """The rigid transform (4, 4), LPS mm, that brings points of the deformed scan into the frame of the scan at rest.

    Raises InputError naming the file when it is no rigid registration, is one of other frames of reference, or does not say
    which of its matrices is whose.
    """
    if not path.is_file():
        raise InputError(f"{path} is not there; correct the path of the registration")
    dataset = read_file(path)
    if dataset is None or dataset.get("Modality") != REGISTRATION:
        raise InputError(f"{path} is no DICOM registration (REG); give one, or leave it out to align on bone")
    if not (rest.is_dicom and deformed.is_dicom):
        raise InputError(f"{path} needs the frames of reference of both scans; import both as DICOM")
    with reading(path):
        if _is_deformable(dataset):
            raise InputError(
                f"{path} is a deformable registration; a rigid one is needed, or leave it out to align on bone"
            )
        to_own = [_to_registered(dataset, *pair, path) for pair in ((rest, deformed), (deformed, rest))]
    return np.asarray(np.linalg.inv(to_own[0]) @ to_own[1], dtype=np.float64)


def unused_registrations(rest: SeriesFacts, deformed: SeriesFacts, places: Sequence[Path]) -> list[str]:
    """One note on each registration of two scans that lies within or beside their folders. places : the folders."""
    notes = []
    beside = [path for place in places for path in _files_beside(place)]
    for path in dict.fromkeys((*rest.registrations, *deformed.registrations, *beside)):
        try:
            read_registration(path, rest, deformed)
        except InputError:
            if _frames(path) >= {rest.telling_frame_of_reference(), deformed.telling_frame_of_reference()}:
                notes.append(
                    f"{path.name} is a registration of these scans that cannot be used: it is not rigid, or damaged"
                )
            continue
        notes.append(f"{path.name} is a registration of these scans and was not used; --registration FILE aligns by it")
    return notes


def _files_beside(folder: Path) -> list[Path]:
    """Registrations among the few files that lie directly beside a scan."""
    files = [path for path in sorted(folder.absolute().parent.iterdir()) if path.is_file()]
    return [path for path in files if _is_registration(path)] if len(files) <= _MOST_FILES else []


def _is_registration(path: Path) -> bool:
    try:
        header = read_file(path, stop_before_pixels=True)
    except InputError:  # nobody gave this file
        return False
    return header is not None and header.get("Modality") == REGISTRATION


def _frames(path: Path) -> set[str | None]:
    """The frames of reference that a registration names."""
    try:
        dataset = read_file(path) or pydicom.Dataset()
        with reading(path):
            items = [
                *(dataset.get("RegistrationSequence") or []),
                *(dataset.get("DeformableRegistrationSequence") or []),
            ]
            own = [each.get("FrameOfReferenceUID") or each.get("SourceFrameOfReferenceUID") for each in items]
            return {str(uid).strip() for uid in (dataset.get("FrameOfReferenceUID"), *own) if uid}
    except InputError:
        return set()


def _is_deformable(dataset: pydicom.Dataset) -> bool:
    return (
        dataset.get("SOPClassUID") == DeformableSpatialRegistrationStorage
        or "DeformableRegistrationSequence" in dataset
    )


def _to_registered(dataset: pydicom.Dataset, scan: SeriesFacts, other: SeriesFacts, path: Path) -> FloatArray:
    """The matrix from a scan's frame into the registration's own. other : the second scan."""
    frame = scan.telling_frame_of_reference()
    alone = frame is not None and frame != other.telling_frame_of_reference()
    found = [
        _matrix(item, path)
        for item in dataset.get("RegistrationSequence") or []
        if _is_of(item, scan, frame if alone else None, other)
    ]
    if not found and alone and str(dataset.get("FrameOfReferenceUID") or "").strip() == frame:
        return np.eye(4)
    if not found:
        why = "registers other frames of reference than those of the two scans"
        if not alone:
            why = "does not name the images of both scans, whose frames of reference do not tell them apart"
        raise InputError(f"{path} {why}; give the registration of these scans, or leave it out to align on bone")
    if any(np.abs(each - found[0]).max() > _SAME for each in found):
        raise InputError(
            f"{path} has several matrices for one of the scans; export the registration of these two alone"
        )
    return found[0]


def _is_of(item: pydicom.Dataset, scan: SeriesFacts, frame: str | None, other: SeriesFacts) -> bool:
    """Whether an item is of a scan. frame : the scan's frame of reference where no other scan has it, else None."""
    images = {str(image.get("ReferencedSOPInstanceUID", "")) for image in item.get("ReferencedImageSequence") or []}
    stated = str(item.get("FrameOfReferenceUID") or "").strip()
    if images & scan.telling_images():
        return stated in ("", scan.frame_of_reference_uid)
    return frame is not None and stated == frame and not images & other.telling_images()


def _matrix(item: pydicom.Dataset, path: Path) -> FloatArray:
    """The rigid matrix (4, 4) of an item. Raises InputError where there is none, or it scales, shears or mirrors."""
    steps = [
        step.get("FrameOfReferenceTransformationMatrix")
        for registration in item.get("MatrixRegistrationSequence") or []
        for step in registration.get("MatrixSequence") or []
    ]
    matrices = [np.array([float(value) for value in step or []], dtype=np.float64) for step in steps]
    if not matrices or any(each.shape != (16,) or not np.isfinite(each).all() for each in matrices):
        raise InputError(f"{path} lacks a matrix of 16 numbers for one of its frames of reference; export it again")
    out, back = np.eye(4), np.eye(4)
    for each in matrices:
        out, back = each.reshape(4, 4) @ out, back @ each.reshape(4, 4)
    if np.abs(out - back).max() > _SAME:
        raise InputError(f"{path} has matrices that must be applied in an order; export it with one matrix")
    turn = out[:3, :3]
    if np.abs(turn.T @ turn - np.eye(3)).max() > _SAME or np.linalg.det(turn) < 0.0 or (out[3] != (0, 0, 0, 1)).any():
        raise InputError(f"{path} is not rigid: its matrix scales, shears or mirrors; give a rigid registration")
    left, _, right = np.linalg.svd(turn)
    out[:3, :3] = left @ right
    return out
