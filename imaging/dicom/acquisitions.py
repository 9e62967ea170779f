"""Several acquisitions under one SeriesInstanceUID, which lie in one another and are no single volume."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.dicom.files import DicomFile
from palpate.imaging.dicom.slices import is_localizer

# What tells the images of one acquisition or reconstruction from those of another, the plainest first.
_TELLING = (
    *("AcquisitionNumber", "TemporalPositionIdentifier", "TemporalPositionIndex", "ConvolutionKernel", "KVP"),
    *("IrradiationEventUID", "SeriesNumber", "SeriesTime"),
    *("ImageType", "AcquisitionDateTime", "AcquisitionTime"),
)
_FEWEST, _MOST = 3, 30
# Acquisitions of which this share lies in the range of another overlap; those of a scan in steps only touch.
_WITHIN = 0.5


def acquisitions(files: Sequence[DicomFile]) -> dict[str, list[DicomFile]]:
    """The files of a series by acquisition, where there are several that overlap: what tells them apart -> files.

    A series that is one volume comes back as it is, under "".
    """
    images = [file for file in files if not is_localizer(file.header)]
    heights = _heights(images)
    if heights is None:
        return {"": list(files)}
    for keyword in _TELLING:
        groups: dict[str, list[int]] = {}
        for index, file in enumerate(images):
            groups.setdefault(_value(file, keyword), []).append(index)
        several = (
            1 < len(groups) <= _MOST and "" not in groups and min(len(group) for group in groups.values()) >= _FEWEST
        )
        if several and _overlap([heights[group] for group in groups.values()]):
            return {f"{keyword} {value}": [images[i] for i in group] for value, group in sorted(groups.items())}
    return {"": list(files)}


def _heights(files: Sequence[DicomFile]) -> FloatArray | None:
    """(n,) mm along the slices' normal; None where a header does not say, or holds many frames."""
    try:
        right, down = np.array([float(v) for v in files[0].header.ImageOrientationPatient]).reshape(2, 3)
        places = np.array([[float(v) for v in file.header.ImagePositionPatient] for file in files])
    except (AttributeError, IndexError, TypeError, ValueError):
        return None
    return places @ np.cross(right, down) if places.shape == (len(files), 3) and np.isfinite(places).all() else None


def _value(file: DicomFile, keyword: str) -> str:
    value = file.header.get(keyword)
    return "" if value is None else "".join(c for c in str(value) if c.isprintable())[:40]


def _overlap(heights: Sequence[FloatArray]) -> bool:
    """Whether any two of the groups lie in one another."""
    for at, one in enumerate(heights):
        for other in heights[at + 1 :]:
            less, more = sorted((one, other), key=len)
            if ((less >= more.min()) & (less <= more.max())).mean() > _WITHIN:
                return True
    return False
