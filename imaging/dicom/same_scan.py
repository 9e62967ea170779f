"""Whether what was drawn belongs to a scan."""

from __future__ import annotations

from collections.abc import Set
from pathlib import Path

import pydicom

from palpate.core.errors import InputError
from palpate.imaging.dicom.series import SeriesFacts, patient_hash


def check_same_scan(dataset: pydicom.Dataset, images: Set[str], facts: SeriesFacts, path: Path) -> None:
    """Raises InputError unless a structure set or segmentation shares the scan's frame of reference or its images.

    images : SOP instances that it says it was drawn on.
    """
    frames = {str(dataset.get("FrameOfReferenceUID", ""))}
    for reference in dataset.get("ReferencedFrameOfReferenceSequence") or []:
        frames.add(str(reference.get("FrameOfReferenceUID", "")))
    if facts.frame_of_reference_uid in frames or images & set(facts.sop_uids):
        return
    if facts.patient_hash is not None and patient_hash(dataset) not in (None, facts.patient_hash):
        raise InputError(f"{path} is of another patient than the CT; give the structure set of this scan")
    raise InputError(
        f"{path} was drawn on another scan (its frame of reference is not the CT's); give the one of this scan"
    )
