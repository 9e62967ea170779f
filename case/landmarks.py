"""Landmarks: points inside the organ that both scans show, such as gold seeds, calcifications and markers."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.surfaces.rigid_motion import transformed

COLUMNS = ("name", "rest_x", "rest_y", "rest_z", "deformed_x", "deformed_y", "deformed_z")


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Matched points. names : n strings. rest, deformed : (n, 3) positions of the same points, LPS mm."""

    names: tuple[str, ...]
    rest: FloatArray
    deformed: FloatArray


def read_landmarks(path: Path, may_miss: Collection[str] = (), may_be_blank: Collection[str] = ()) -> Landmarks:
    """Points of a CSV file in the form of docs/case.md: landmarks.csv, or the points file of a state.

    may_miss : columns that need not be there. may_be_blank : columns in which a cell may be empty. Both are NaN then.
    Raises InputError naming the file when it is unreadable, lacks a column, holds no point or repeats a name, and
    naming the line too when a point has no name or a coordinate is no finite number.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = _rows(csv.DictReader(stream), path, may_miss, {*may_miss, *may_be_blank})
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} is not a readable CSV file; save it again as CSV in UTF-8") from error
    names = tuple(name for name, _ in rows)
    if not rows:
        raise InputError(f"{path} holds no point; add points or remove the file")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{path} names the point {twice!r} more than once; give each its own name")
    values = np.array([numbers for _, numbers in rows])
    return Landmarks(names, values[:, :3], values[:, 3:])


def _rows(
    reader: csv.DictReader[str], path: Path, may_miss: Collection[str], may_be_blank: Collection[str]
) -> list[tuple[str, list[float]]]:
    header = [name.strip() for name in reader.fieldnames or ()]
    missing = [column for column in COLUMNS if column not in header and column not in may_miss]
    if missing:
        raise InputError(f"{path} lacks the column {missing[0]}; its first line must be {','.join(COLUMNS)}")
    reader.fieldnames = header
    return [(_name(row, path, reader.line_num), _numbers(row, path, reader.line_num, may_be_blank)) for row in reader]


def _name(row: dict[str, str], path: Path, line: int) -> str:
    name = (row["name"] or "").strip()
    if not name:
        raise InputError(f"{path} line {line}: the point has no name; give it one")
    return name


def _numbers(row: dict[str, str], path: Path, line: int, may_be_blank: Collection[str]) -> list[float]:
    numbers = []
    for column in COLUMNS[1:]:
        if column in may_be_blank and not (row.get(column) or "").strip():
            numbers.append(np.nan)
            continue
        try:
            number = float(row[column])
        except (TypeError, ValueError):
            number = np.nan
        if not np.isfinite(number):
            raise InputError(f"{path} line {line}: {column} is {row[column]!r}; a number in mm is needed")
        numbers.append(number)
    return numbers


def landmarks_csv(points: Landmarks, deformed_to_rest: FloatArray) -> str:
    """Text of landmarks.csv. deformed_to_rest : (4, 4) rigid transform, mm, of the deformed points into the rest
    frame.
    """
    moved = transformed(deformed_to_rest, points.deformed)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for name, rest, deformed in zip(points.names, points.rest, moved, strict=True):
        writer.writerow([name, *(f"{value:.4f}" for value in (*rest, *deformed))])
    return stream.getvalue()
