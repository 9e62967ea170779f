"""What a person measured on the slices of a case, `measurements.json`: distances, angles, regions of the stiffness map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import msgspec
import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError

FILE = "measurements.json"
REGIONS = ("ellipse", "region")
_POINTS = {"distance": (2, 2), "angle": (3, 3), "ellipse": (3, 10_000), "region": (3, 10_000)}
Point = tuple[float, float, float]


class Measurement(msgspec.Struct, frozen=True):
    """One measurement on a slice.

    name : a letter. points : mm LPS in the frame of the scan at rest: two ends; end, vertex and other end; or the
    closed outline of a region. plane : of the slice.
    """

    name: str
    kind: Literal["distance", "angle", "ellipse", "region"]
    plane: Literal["axial", "sagittal", "coronal"]
    points: tuple[Point, ...]


class _Measurements(msgspec.Struct, frozen=True):
    measurements: tuple[Measurement, ...]


def read_measurements(case: CaseFolder) -> tuple[Measurement, ...]:
    """Measurements of a case, none where it has no such file. Raises InputError naming the file when it is damaged."""
    if not case.has(FILE):
        return ()
    found = case.read(FILE, _Measurements, "; correct it or remove it").measurements
    for one in found:
        least, most = _POINTS[one.kind]
        if not least <= len(one.points) <= most or not np.isfinite(np.array(one.points)).all():
            raise InputError(f"{case.file(FILE)}: {one.name} is no {one.kind}; correct it or remove the file")
    return found


def write_measurements(case: CaseFolder, found: Sequence[Measurement]) -> None:
    """Writes the measurements of a case; without any there is no file."""
    if found:
        case.write_json(FILE, msgspec.to_builtins(_Measurements(tuple(found))))
    else:
        case.remove(FILE)


def length_mm(points: Sequence[Point]) -> float:
    """Distance between two points, mm."""
    return float(np.linalg.norm(np.subtract(points[0], points[1])))


def angle_degrees(points: Sequence[Sequence[float]]) -> float:
    """The angle at the second of three points, 0 to 180; 0 where two of them are the same."""
    first, vertex, last = (np.asarray(point, dtype=float) for point in points)
    a, b = first - vertex, last - vertex
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(a @ b / lengths, -1.0, 1.0)))) if lengths > 0.0 else 0.0
