"""STL and OBJ files as other programs write them, and what is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from palpate.core.errors import InputError
from palpate.imaging.surfaces.surface_files import read_closed_surface
from palpate.imaging.surfaces.triangle_files import read_triangles

BALL = pv.Icosphere(radius=20.0, center=(3.0, -4.0, 5.0), nsub=2)


def text_stl(path: Path) -> str:
    BALL.save(path, binary=False)
    return path.read_text()


@pytest.mark.parametrize("form", ["binary.stl", "text.stl", "text.obj"])
def test_points_and_faces_come_in_the_files_order(form: str, tmp_path: Path) -> None:
    """As VTK reads them, so that what was made from a surface before is made again."""
    path = tmp_path / form
    BALL.save(path, binary=form.startswith("binary")) if path.suffix == ".stl" else BALL.save(path)
    points, faces = read_triangles(path)
    other = pv.read(path)
    np.testing.assert_allclose(points, other.points, atol=1e-6)
    np.testing.assert_array_equal(faces, other.regular_faces)


@pytest.mark.parametrize("start", ["   ", "\n\n", "\ufeff"])
def test_text_that_begins_with_blanks_or_a_mark(start: str, tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    path.write_text(start + text_stl(path), encoding="utf-8")
    assert read_closed_surface(path).surface.enclosed_volume == pytest.approx(BALL.volume, rel=1e-5)


def test_bytes_behind_the_triangles_of_a_binary_stl(tmp_path: Path) -> None:
    BALL.save(tmp_path / "a.stl", binary=True)
    with (tmp_path / "a.stl").open("ab") as stream:
        stream.write(b"made by someone")
    assert read_closed_surface(tmp_path / "a.stl").surface.enclosed_volume == pytest.approx(BALL.volume, rel=1e-5)


@pytest.mark.parametrize("suffix", [".obj", ".ply"])
def test_a_byte_order_mark(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{suffix}"
    BALL.save(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_closed_surface(path).surface.enclosed_volume == pytest.approx(BALL.volume, rel=1e-5)


def test_polygons_of_an_obj_and_a_material_that_is_not_there(tmp_path: Path) -> None:
    corners = [(x, y, z) for x in (0, 10) for y in (0, 10) for z in (0, 10)]
    lines = ["mtllib absent.mtl", "usemtl gold", *(f"v {x} {y} {z}" for x, y, z in corners)]
    lines += ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f -7 -3 -1 -5"]
    (tmp_path / "a.obj").write_text("\n".join(lines) + "\n")
    assert read_closed_surface(tmp_path / "a.obj").surface.enclosed_volume == pytest.approx(1000.0)


def test_what_is_not_readable_is_refused_in_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.stl"
    good = text_stl(path)
    BALL.save(path, binary=True)
    binary = path.read_bytes()
    obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"
    for name, data in {
        "comma.stl": good.replace(".", ",").encode(),
        "cut.stl": binary[: len(binary) // 2],
        "comma.obj": b"v 0,5 0 0\nv 1,5 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n",
        "half.stl": good[: len(good) // 2].encode(),
        "word.stl": good.replace("vertex", "vertx").encode(),
        "far.obj": obj.encode(),
        "none.obj": b"o nothing\n",
    }.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=name) as refused:
            read_closed_surface(tmp_path / name)
        assert "\n" not in str(refused.value)
    told = capfd.readouterr()
    assert told.err == "" and told.out == ""
