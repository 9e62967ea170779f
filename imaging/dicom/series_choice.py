"""Which of the series in a folder is meant."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from palpate.core.errors import InputError
from palpate.imaging.dicom.files import DicomFile
from palpate.imaging.dicom.slices import is_image, is_localizer


def choose_series(
    files: Sequence[DicomFile], folder: Path, series: str | None, modalities: Sequence[str]
) -> list[DicomFile]:
    """The files of the one image series of the wanted modalities, or of the one that ``series`` names.

    series : number in the list of choices (from 1), or beginning or end of the SeriesInstanceUID.

    Raises InputError listing the choices when there is none or more than one.
    """
    groups = _image_series(files, modalities)
    if not groups:
        wanted = " or ".join(modalities)
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
            f"{folder} holds {len(groups)} series; choose one with --series (or --rest-series, --deformed-series): {_choices(groups)}"
        )
    return next(iter(groups.values()))


def _image_series(files: Sequence[DicomFile], modalities: Sequence[str]) -> dict[str, list[DicomFile]]:
    groups: dict[str, list[DicomFile]] = {}
    for file in files:
        if file.header.get("Modality") in modalities and is_image(file.header):
            groups.setdefault(str(file.header.get("SeriesInstanceUID", "")), []).append(file)
    return {uid: group for uid, group in groups.items() if not all(is_localizer(f.header) for f in group)}


def _named(series: str, uids: list[str]) -> list[str]:
    text = series.strip()
    if text.isdigit() and 1 <= int(text) <= len(uids):
        return [uids[int(text) - 1]]
    return [uid for uid in uids if text and (uid.startswith(text) or uid.endswith(text))]


def _choices(groups: dict[str, list[DicomFile]]) -> str:
    lines = []
    for number, uid in enumerate(sorted(groups), start=1):
        header = groups[uid][0].header
        size = f"{header.get('Columns')} x {header.get('Rows')}"
        date = _printable(header.get("SeriesDate") or header.get("AcquisitionDate") or "no date")
        lines.append(f"{number} ({date}, {len(groups[uid])} files of {size}, UID ends in {uid[-12:]})")
    shown = lines[:20] + ([f"and {len(lines) - 20} more"] if len(lines) > 20 else [])
    return ", ".join(shown)


def _summary(files: Sequence[DicomFile]) -> str:
    kinds = [_printable(file.header.get("Modality") or "unnamed") for file in files]
    return ", ".join(f"{kinds.count(kind)} {kind}" for kind in sorted(set(kinds)))


def _printable(value: object) -> str:
    """A header's short value for a message of one line: a damaged one may hold line ends."""
    return "".join(c for c in str(value) if c.isprintable())[:16]
