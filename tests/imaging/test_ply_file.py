"""PLY files as VTK and others write them, and damaged ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from palpate.core.errors import InputError
from palpate.imaging.surfaces.ply import read_ply

BALL = pv.Icosphere(radius=20.0, center=(3.0, -4.0, 5.0), nsub=1)

MIXED = """ply
format ascii 1.0
comment other properties, a square and a triangle
element vertex 5
property double x
property double y
property double z
property uchar red
element face 2
property list uchar int vertex_index
property float quality
end_header
0 0 0 9
1 0 0 9
1 1 0 9
0 1 0 9
0.5 0.5 1 9
4 0 1 2 3 0.5
3 0 1 4 1e2
"""


@pytest.mark.parametrize("binary", [True, False])
def test_what_vtk_writes(binary: bool, tmp_path: Path) -> None:
    BALL.save(tmp_path / "a.ply", binary=binary)
    points, faces = read_ply(tmp_path / "a.ply")
    assert np.allclose(points, BALL.points, atol=1e-5)
    assert np.array_equal(faces, BALL.regular_faces)


def test_polygons_become_fans(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text(MIXED)
    points, faces = read_ply(tmp_path / "a.ply")
    assert points[4].tolist() == [0.5, 0.5, 1.0]
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 4]]


def test_mixed_polygons_in_a_big_endian_file(tmp_path: Path) -> None:
    head = MIXED.split("end_header")[0].replace("ascii", "binary_big_endian") + "end_header\n"
    body = b"".join(np.array(p, ">f8").tobytes() + b"\x09" for p in np.arange(15.0).reshape(5, 3))
    for face in ([0, 1, 2, 3], [0, 1, 4]):
        body += bytes([len(face)]) + np.array(face, ">i4").tobytes() + np.array([0.5], ">f4").tobytes()
    (tmp_path / "a.ply").write_bytes(head.encode() + body)
    points, faces = read_ply(tmp_path / "a.ply")
    assert np.array_equal(points, np.arange(15.0).reshape(5, 3))
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 4]]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("3 0 1 4", "3 0 1 7", "names a point which does not exist"),
        ("4 0 1 2 3 0.5", "9 0 1 2 3 0.5", "not readable as PLY"),
        ("element face 2", "element face 99999999999", "not readable as PLY"),
        ("vertex_index", "something", "not readable as PLY"),
        ("double z", "double w", "not readable as PLY"),
    ],
)
def test_damage_is_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text(MIXED.replace(old, new))
    with pytest.raises(InputError, match=message):
        read_ply(tmp_path / "a.ply")
