"""Which of the series in a folder is meant."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import pydicom

from palpate.core.errors import InputError
from palpate.imaging.dicom.acquisitions import acquisitions
from palpate.imaging.dicom.files import DicomFile
from palpate.imaging.dicom.slices import is_image, is_localizer, kind_of, plane_of
from palpate.imaging.dicom.stack import MIN_SLICES


def choose_series(
    files: Sequence[DicomFile], folder: Path, series: str | None, modalities: Sequence[str]
) -> list[DicomFile]:
    """The files of the one image series of the wanted modalities, or of the one that ``series`` names.

    series : number in the list of choices (from 1), or beginning or end of the SeriesInstanceUID.

    Raises InputError listing the choices when there is none or more than one.
    """
    groups, scouts = image_series(files, modalities)
    if not groups:
        wanted = " or ".join(modalities)
        if scouts:
            raise InputError(
                f"{folder} holds a localizer (scout view) only, no {wanted} volume: {_choices(scouts)}; give the folder of the "
                "series of slices"
            )
        raise InputError(
            f"{folder} holds no {wanted} image series, only {_summary(files)}; give the folder of the {wanted} series"
        )
    if series is not None:
        chosen = _named(series, sorted(groups))
        if len(chosen) != 1:
            which = "no series" if not chosen else f"{len(chosen)} series"
            raise InputError(f"{folder}: --series {series} names {which}; choose one of {_choices(groups)}")
        return groups[chosen[0]]
    if len(groups) > 1:
        raise InputError(
            f"{folder} holds {len(groups)} series; choose one with --series (or --rest-series, --deformed-series): "
            f"{_choices(groups)}{_left_out(scouts)}"
        )
    return next(iter(groups.values()))


Groups = dict[str, list[DicomFile]]


def image_series(files: Sequence[DicomFile], modalities: Sequence[str]) -> tuple[Groups, Groups]:
    """The series of slices, by UID and where needed acquisition, and those that are localizers only."""
    by_uid: Groups = {}
    for file in files:
        if file.header.get("Modality") in modalities and is_image(file.header):
            by_uid.setdefault(str(file.header.get("SeriesInstanceUID", "")), []).append(file)
    scouts = {uid: group for uid, group in by_uid.items() if _is_scout(group)}
    found: Groups = {}
    for uid, group in by_uid.items():
        if uid not in scouts:
            found |= {f"{uid} {told}".strip(): part for told, part in acquisitions(group).items()}
    return found, scouts


def _is_scout(group: Sequence[DicomFile]) -> bool:
    if all(is_localizer(file.header) for file in group):
        return True
    return len(group) < MIN_SLICES and all(kind_of(file.header) in ("localizer", "survey") for file in group)


def _named(series: str, uids: list[str]) -> list[str]:
    text = series.strip()
    if text.isdigit() and 1 <= int(text) <= len(uids):
        return [uids[int(text) - 1]]
    return [uid for uid in uids if text and (uid.startswith(text) or uid.partition(" ")[0].endswith(text))]


def _choices(groups: Groups) -> str:
    lines = []
    for number, key in enumerate(sorted(groups), start=1):
        header, (uid, _, told) = groups[key][0].header, key.partition(" ")
        date = printable(header.get("SeriesDate") or header.get("AcquisitionDate") or "no date")
        size = f"{len(groups[key])} files of {header.get('Columns')} x {header.get('Rows')}"
        facts = [
            date,
            size,
            told,
            description_of(header),
            plane_of(header),
            kind_of(header),
            f"UID ends in {uid[-12:]}",
        ]
        lines.append(f"{number} ({', '.join(fact for fact in facts if fact)})")
    shown = lines[:20] + ([f"and {len(lines) - 20} more"] if len(lines) > 20 else [])
    return ", ".join(shown)


def _left_out(scouts: Groups) -> str:
    return f"; left out: {len(scouts)} of localizers (scout views)" if scouts else ""


def description_of(header: pydicom.Dataset) -> str:
    """What the scanner's operator called the series, unless it names the patient."""
    text = printable(header.get("SeriesDescription") or "", 40).strip()
    person = re.findall(r"\w{3,}", f"{header.get('PatientName') or ''} {header.get('PatientID') or ''}".casefold())
    return "" if not text or any(word in text.casefold() for word in person) else repr(text)


def _summary(files: Sequence[DicomFile]) -> str:
    kinds = [printable(file.header.get("Modality") or "unnamed") for file in files]
    return ", ".join(f"{kinds.count(kind)} {kind}" for kind in sorted(set(kinds)))


def printable(value: object, longest: int = 16) -> str:
    """A header's short value for a message of one line: a damaged one may hold line ends."""
    return "".join(c for c in str(value) if c.isprintable())[:longest]
