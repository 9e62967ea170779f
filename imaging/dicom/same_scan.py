"""Whether what was drawn belongs to a scan."""

from __future__ import annotations

from collections.abc import Set
from pathlib import Path

import pydicom

from palpate.core.errors import InputError
from palpate.imaging.dicom.series import SeriesFacts, patient_hash

NOT_CHECKED = "neither the scan nor what was drawn says which scan it belongs to: that was not checked"
NO_DICOM = "the scan is no DICOM: that this was drawn on it was not checked"


def check_same_scan(dataset: pydicom.Dataset, images: Set[str], facts: SeriesFacts, path: Path) -> list[str]:
    """Notes on whether a structure set or segmentation belongs to a scan. What is blank, or alike everywhere, tells nothing.

    images : SOP instances that it says it was drawn on.

    Raises InputError when it belongs to another scan or patient, or nothing says that it belongs to this one.
    """
    if not facts.is_dicom:
        return [NO_DICOM]
    frames = {str(dataset.get("FrameOfReferenceUID") or "").strip()}
    for reference in dataset.get("ReferencedFrameOfReferenceSequence") or []:
        frames.add(str(reference.get("FrameOfReferenceUID") or "").strip())
    here, own_images = facts.telling_frame_of_reference(), facts.telling_images()
    frames -= {"", facts.frame_of_reference_uid} if here is None else {""}
    images = images - {""}
    if here in frames or images & own_images:
        return []
    patients = {facts.patient_hash, patient_hash(dataset)} - {None}
    if len(patients) == 2:
        raise InputError(f"{path} is of another patient than the CT; give the structure set of this scan")
    if (here is not None and frames) or (own_images and images):
        raise InputError(
            f"{path} was drawn on another scan (its frame of reference is not the CT's); give the one of this scan"
        )
    both_named = facts.patient_hash is not None and patient_hash(dataset) is not None
    scan_tells, drawing_tells = here is not None or bool(own_images), bool(frames or images)
    if (drawing_tells or scan_tells) and not (both_named and here is None):
        raise InputError(f"{path} does not say that it was drawn on this scan; give one with references to its images")
    return [NOT_CHECKED]
