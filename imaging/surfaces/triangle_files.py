"""Triangles of STL and OBJ files, read by trimesh. PLY has a reader of its own (``ply``), and why."""

from __future__ import annotations

import codecs
import io
import logging
import re
import warnings
from pathlib import Path

import numpy as np
import trimesh

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError

# What trimesh raises on damaged files.
_DAMAGE = (
    *(
        ArithmeticError,
        AttributeError,
        LookupError,
        MemoryError,
        NameError,
        OSError,
        RuntimeError,
        TypeError,
        ValueError,
    ),
    Warning,
)
# Bytes of a binary STL before its triangles, the last four of which count them; and of a triangle.
_STL_HEAD, _STL_FACE = 84, 50
# A face of an OBJ file, one of whose corners is vertex 0.
_NAMES_0 = re.compile(rb"^[ \t]*f[ \t](?:[^\n]*[ \t])?0+(?:[/ \t\r\n]|$)", re.MULTILINE)
logging.getLogger("trimesh").setLevel(logging.CRITICAL)


def read_triangles(path: Path) -> tuple[FloatArray, IntArray]:
    """Points (n, 3) and triangles (f, 3) of an STL or OBJ file; polygons are cut into triangles.

    STL lists each triangle's corners by themselves: equal ones are one point, in the order in which they come.
    Raises InputError naming the file when it cannot be read, or a face names a point that is not there.
    """
    kind, content = path.suffix.lower()[1:], _content(path)
    if kind == "obj" and _NAMES_0.search(content):
        raise InputError(f"{path} has a face that names vertex 0, but OBJ counts from 1; save it again")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numbers of a damaged file that are too large; looked at afterwards
            # numpy stops at a number that it cannot read, and only warns.
            warnings.simplefilter("error", DeprecationWarning)
            found = trimesh.load_scene(
                io.BytesIO(content), file_type=kind, process=False, maintain_order=True, skip_materials=True
            )
            parts = [part for part in found.dump() if isinstance(part, trimesh.Trimesh)]
            points = [np.asarray(part.vertices, dtype=np.float64) for part in parts]
            faces = [np.asarray(part.faces, dtype=np.int64) for part in parts]
    except _DAMAGE as error:
        raise InputError(f"{path} is not readable as {kind.upper()}; save it again") from error
    if not parts:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    if any(
        p.ndim != 2 or p.shape[1] != 3 or f.ndim != 2 or f.shape[1] != 3 for p, f in zip(points, faces, strict=True)
    ):
        raise InputError(f"{path} has points or faces that are not three numbers; save it again")
    if any(f.size and (f.min() < 0 or f.max() >= len(p)) for p, f in zip(points, faces, strict=True)):
        raise InputError(f"{path} has a face that names a point which does not exist; save it again")
    starts = np.cumsum([0, *(len(p) for p in points[:-1])])
    X, F = np.concatenate(points), np.concatenate([f + s for f, s in zip(faces, starts, strict=True)])
    return _joined(X, F) if kind == "stl" else (X, F)


def _content(path: Path) -> bytes:
    """A file's bytes without a byte order mark, and of a binary STL without what follows its triangles."""
    data = path.read_bytes().removeprefix(codecs.BOM_UTF8)
    if path.suffix.lower() == ".stl" and len(data) > _STL_HEAD and b"facet" not in data[:1000].lower():
        end = _STL_HEAD + _STL_FACE * int.from_bytes(data[_STL_HEAD - 4 : _STL_HEAD], "little")
        return data[:end] if end > _STL_HEAD else data
    return data


def _joined(points: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Equal corners as one point, faces of no area dropped."""
    # STL holds single precision; text is rounded to it, as binary files are.
    with np.errstate(all="ignore"):
        single = points.astype(np.float32)
    _, first, of = np.unique(single, axis=0, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    order = np.argsort(first)
    rank[order] = np.arange(len(first))
    joined = rank[of.reshape(-1)][faces]
    apart = (joined[:, 0] != joined[:, 1]) & (joined[:, 1] != joined[:, 2]) & (joined[:, 2] != joined[:, 0])
    return single[first[order]].astype(np.float64), joined[apart]
