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
from palpate.core.files.csv_table import Row, read_csv_table
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
    rows = read_csv_table(path, [column for column in COLUMNS if column not in may_miss], may_miss)
    names = tuple(_name(row, path) for row in rows)
    if not rows:
        raise InputError(f"{path} holds no point; add points or remove the file")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{path} names the point {twice!r} more than once; give each its own name")
    values = np.array([_numbers(row, path, {*may_miss, *may_be_blank}) for row in rows])
    return Landmarks(names, values[:, :3], values[:, 3:])


def _name(row: Row, path: Path) -> str:
    if not row.cells["name"]:
        raise InputError(f"{path} line {row.line}: the point has no name; give it one")
    return row.cells["name"]


def _numbers(row: Row, path: Path, may_be_blank: Collection[str]) -> list[float]:
    numbers = []
    for column in COLUMNS[1:]:
        text = row.cells.get(column, "")
        if column in may_be_blank and not text:
            numbers.append(np.nan)
            continue
        try:
            number = float(text)
        except ValueError:
            number = np.nan
        if not np.isfinite(number):
            raise InputError(f"{path} line {row.line}: {column} is {text!r}; a number in mm is needed")
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
