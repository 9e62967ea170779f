"""Triangles of a PLY file.

An own reader, because others fail: VTK's ends the whole program on damaged files; trimesh's (5.2) refuses binary files of mixed
polygons, and reads without a word those whose faces name points that are not there or that end before their header says.
"""

from __future__ import annotations

import codecs
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LISTS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Element:
    """count rows of properties: (name, type, type of the list's length or "")."""

    name: str
    count: int
    properties: tuple[tuple[str, str, str], ...]


def read_ply(path: Path) -> tuple[FloatArray, IntArray]:
    """Points (n, 3) and triangles (f, 3) of a PLY file, ASCII or binary; polygons become fans.

    Raises InputError naming the file when it is damaged or holds no faces.
    """
    try:
        data = path.read_bytes().removeprefix(codecs.BOM_UTF8)
        order, elements, start = _header(data)
        rows = _ascii(data[start:], elements) if order == "" else _binary(data, start, order, elements)
        points = np.column_stack([_column(rows["vertex"], axis) for axis in "xyz"]).astype(np.float64)
        faces = _triangles(rows["face"])
    except (OSError, ValueError, LookupError, TypeError, OverflowError, MemoryError) as error:
        raise InputError(f"{path} is not readable as PLY; save it again") from error
    if len(faces) and (faces.min() < 0 or faces.max() >= len(points)):
        raise InputError(f"{path} has a face that names a point which does not exist; save it again")
    return points, faces


def _header(data: bytes) -> tuple[str, list[_Element], int]:
    end = data.index(b"end_header")
    start = data.index(b"\n", end) + 1
    lines = [line.split() for line in data[:end].decode("ascii").splitlines()]
    if lines[0] != ["ply"]:
        raise ValueError("no PLY file")
    order, elements = "", []
    for words in lines[1:]:
        if words[:1] == ["format"]:
            order = _ORDERS[words[1]]
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2]), ()))
        elif words[:1] == ["property"]:
            listed = words[1] == "list"
            new = (words[-1], _TYPES[words[-2]], _TYPES[words[2]] if listed else "")
            last = elements[-1]
            elements[-1] = _Element(last.name, last.count, (*last.properties, new))
    if any(not 0 <= e.count <= len(data) for e in elements):
        raise ValueError("more rows than the file has bytes")
    return order, elements, start


Rows = dict[str, dict[str, NDArray[np.generic] | list[NDArray[np.generic]]]]


def _ascii(body: bytes, elements: list[_Element]) -> Rows:
    lines = iter(line.split() for line in body.decode("ascii").splitlines() if line.strip())
    found: Rows = {}
    for element in elements:
        table: list[list[object]] = []
        for _ in range(element.count):
            words, at, row = next(lines, []), 0, []
            for _name, kind, length in element.properties:
                size = int(words[at]) if length else 1
                values = np.array(words[at + bool(length) : at + bool(length) + size], dtype=np.float64)
                if size < 0 or len(values) != size:
                    raise ValueError("a row ends early")
                row.append(values.astype(kind) if length else values[0])
                at += size + bool(length)
            table.append(row)
        columns = list(zip(*table, strict=True)) if table else [()] * len(element.properties)
        found[element.name] = {
            name: list(column) if length else np.array(column, dtype=np.float64)
            for (name, _, length), column in zip(element.properties, columns, strict=True)
        }
    return found


def _binary(data: bytes, at: int, order: str, elements: list[_Element]) -> Rows:
    found: Rows = {}
    for element in elements:
        # Lists are nearly always triangles throughout: read at once where they are, else one by one.
        sizes = {name: _first_size(data, at, order, element) for name, _, length in element.properties if length}
        fields: list[tuple[Any, ...]] = []
        for name, kind, length in element.properties:
            fields += [(f"{name} length", order + length)] if length else []
            fields += [(name, order + kind, (sizes[name],)) if length else (name, order + kind)]
        dtype = np.dtype(fields)
        fits = at + element.count * dtype.itemsize <= len(data)
        table = np.frombuffer(data, dtype, element.count, at) if fits and element.count else np.empty(0, dtype)
        if fits and all((table[f"{name} length"] == size).all() for name, size in sizes.items()):
            found[element.name] = {name: table[name] for name, _, _ in element.properties}
            at += element.count * dtype.itemsize
        else:
            found[element.name], at = _one_by_one(data, at, order, element)
    return found


def _first_size(data: bytes, at: int, order: str, element: _Element) -> int:
    """Length of the first row's list, where it is the first property; else triangles are expected."""
    length = element.properties[0][2]
    if not length or not element.count:
        return 3
    size = int(np.frombuffer(data, order + length, 1, at)[0])
    return size if 0 < size < 1000 else 3


def _one_by_one(
    data: bytes, at: int, order: str, element: _Element
) -> tuple[dict[str, NDArray[np.generic] | list[NDArray[np.generic]]], int]:
    lists: dict[str, list[NDArray[np.generic]]] = {name: [] for name, _, _ in element.properties}
    for _ in range(element.count):
        for name, kind, length in element.properties:
            size = 1
            if length:
                size = int(np.frombuffer(data, order + length, 1, at)[0])
                at += np.dtype(length).itemsize
            lists[name].append(np.frombuffer(data, order + kind, size, at))
            at += size * np.dtype(kind).itemsize
    return dict(lists), at


def _column(rows: dict[str, NDArray[np.generic] | list[NDArray[np.generic]]], name: str) -> NDArray[np.generic]:
    return np.asarray(rows[name]).reshape(-1)


def _triangles(rows: dict[str, NDArray[np.generic] | list[NDArray[np.generic]]]) -> IntArray:
    polygons = rows[_LISTS[0] if _LISTS[0] in rows else _LISTS[1]]
    fans = [np.asarray(p, dtype=np.int64) for p in polygons] if isinstance(polygons, list) else None
    if fans is None:
        table = np.asarray(polygons, dtype=np.int64)
        return np.concatenate(
            [table[:, [0, k, k + 1]] for k in range(1, table.shape[1] - 1)] or [np.empty((0, 3), np.int64)]
        )
    made = [np.column_stack([np.full(len(p) - 2, p[0]), p[1:-1], p[2:]]) for p in fans if len(p) > 2]
    return np.concatenate(made) if made else np.empty((0, 3), dtype=np.int64)
