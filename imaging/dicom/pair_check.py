"""Whether two CT series are two scans of one patient."""

from __future__ import annotations

import hashlib
from datetime import date

import numpy as np

from palpate.core.errors import InputError
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

# Beyond this the anatomy may have changed by itself.
FAR_APART_DAYS = 92


def check_pair(
    rest: tuple[Volume, SeriesFacts], deformed: tuple[Volume, SeriesFacts], same_patient: bool = False
) -> list[str]:
    """Notes on a pair of scans.

    same_patient : the caller vouches for it, where the scans' patient numbers or names differ.

    Raises InputError when both are the same scan, or of two patients.
    """
    (rest_volume, rest_facts), (deformed_volume, deformed_facts) = rest, deformed
    folders = f"{rest_facts.place} and {deformed_facts.place}"
    notes = []
    told = rest_facts.telling_images(), deformed_facts.telling_images()
    if _shared(rest_facts, deformed_facts) if told[0] and told[1] else rest_facts.paths == deformed_facts.paths:
        raise InputError(f"{folders} hold the same scan; give a scan at rest and another one with the organ deformed")
    if _same_voxels(rest_volume, deformed_volume):
        raise InputError(
            f"{folders} hold the same voxels under two names; give a scan at rest and another one with the organ deformed"
        )
    if not (told[0] and told[1]):
        dicom = rest_facts.is_dicom and deformed_facts.is_dicom
        why = "the scans' UIDs were removed or made alike" if dicom else "a scan that is no DICOM has no UIDs"
        notes.append(f"{why}: that they are two scans was told by their voxels")
    elif rest_facts.series_uid == deformed_facts.series_uid:
        notes.append(
            "both scans have one series UID, but no image in common and other voxels: they were taken as two scans"
        )
    known = (rest_facts.patient_hash, deformed_facts.patient_hash)
    if None in known:
        notes.append("a scan does not name its patient: that both are of one patient was not checked")
    elif known[0] != known[1] and not same_patient:
        raise InputError(
            f"{folders} are of two patients by number or name; give two scans of one patient, or --same-patient if they are"
        )
    days = _days_apart(rest_facts.study_date, deformed_facts.study_date)
    if days is not None and days > FAR_APART_DAYS:
        notes.append(f"the scans were made {days} days apart: the anatomy may have changed by itself")
    return notes


def _shared(rest: SeriesFacts, deformed: SeriesFacts) -> bool:
    """Whether two series have an image in common."""
    return not set(zip(rest.sop_uids, rest.frames, strict=True)).isdisjoint(
        zip(deformed.sop_uids, deformed.frames, strict=True)
    )


def _same_voxels(rest: Volume, deformed: Volume) -> bool:
    """Whether most slices of one are slices of the other, to the last bit; those of one value throughout do not count."""
    hashes = []
    for volume in (rest, deformed):
        slices = [np.ascontiguousarray(volume.array[:, :, k]) for k in range(volume.array.shape[2])]
        hashes.append({hashlib.sha256(each.tobytes()).digest() for each in slices if np.ptp(each) > 0})
    fewest = min(len(each) for each in hashes)
    return bool(fewest) and len(hashes[0] & hashes[1]) > 0.5 * fewest


def _days_apart(first: str | None, second: str | None) -> int | None:
    if first is None or second is None:
        return None
    try:
        days = [date(int(text[:4]), int(text[4:6]), int(text[6:])) for text in (first, second)]
    except ValueError:
        return None
    return abs((days[1] - days[0]).days)
