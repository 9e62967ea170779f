"""Surface files that state a unit or a space in their header, and what is wrong with others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from palpate.core.errors import InputError
from palpate.imaging.surfaces.surface_files import read_closed_surface
from palpate.imaging.surfaces.triangle_files import read_triangles

CENTRE = np.array([11.0, -5.0, 7.0])


def box(scale: float = 1.0) -> pv.PolyData:
    """A box of 20 x 30 x 40 mm around CENTRE, in units of ``scale`` mm."""
    half = np.array([10.0, 15.0, 20.0])
    ends = np.column_stack([CENTRE - half, CENTRE + half]).ravel()
    return pv.Box(tuple(ends), level=2).triangulate().clean().scale(1.0 / scale)


def obj(path: Path, comment: str, mesh: pv.PolyData) -> Path:
    lines = [comment, *(f"v {x} {y} {z}" for x, y, z in mesh.points.astype(float).tolist())]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.regular_faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def stl(path: Path, header: bytes, mesh: pv.PolyData) -> Path:
    mesh.save(path)
    path.write_bytes(header.ljust(80)[:80] + path.read_bytes()[80:])
    return path


def ply(path: Path, comment: str, mesh: pv.PolyData) -> Path:
    mesh.save(path, binary=False)
    first, _, rest = path.read_text().partition("\nformat")
    path.write_text(f"{first}\nformat{rest}".replace("element vertex", f"comment {comment}\nelement vertex", 1))
    return path


@pytest.mark.parametrize(
    ("statement", "turned"),
    [("3D Slicer output. SPACE=RAS", True), ("SPACE=LPS", False), ("made with space and care", False)],
)
def test_a_stated_space_is_turned_to_lps(statement: str, turned: bool, tmp_path: Path) -> None:
    files = [
        stl(tmp_path / "a.stl", statement.encode(), box()),
        obj(tmp_path / "a.obj", f"# {statement}", box()),
        ply(tmp_path / "a.ply", statement, box()),
    ]
    for file in files:
        read = read_closed_surface(file)
        centre = 0.5 * (read.surface.points.min(axis=0) + read.surface.points.max(axis=0))
        np.testing.assert_allclose(centre, CENTRE * (-1, -1, 1) if turned else CENTRE, atol=1e-4)
        assert read.surface.enclosed_volume == pytest.approx(24000.0, rel=1e-4)
        assert [note for note in read.notes if "turned to LPS" in note] == (
            ["the file states SPACE=RAS: its points were turned to LPS"] if turned else []
        )


@pytest.mark.parametrize(
    ("statement", "mm"),
    [
        ("vertex coordinates are measured in units, where 1 unit = 10.000000 mm", 10.0),
        ("File units = meters", 1000.0),
        ("units: inches", 25.4),
        ("UNITS=mm", 1.0),
        ("no units here", 1.0),
    ],
)
def test_a_stated_unit_scales(statement: str, mm: float, tmp_path: Path) -> None:
    for file in (
        obj(tmp_path / "a.obj", f"# {statement}", box(mm)),
        stl(tmp_path / "a.stl", statement.encode(), box(mm)),
    ):
        if mm != 1.0 and file.suffix == ".stl" and len(statement) > 80:
            continue
        read = read_closed_surface(file)
        assert read.surface.enclosed_volume == pytest.approx(24000.0, rel=1e-3)
        assert any("its lengths were multiplied" in note for note in read.notes) == (mm != 1.0)


@pytest.mark.parametrize("statement", ["SPACE=LAS", "units = furlongs", "1 unit = 2 furlongs"])
def test_a_frame_that_is_not_known_is_refused_with_its_words(statement: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"a.obj states '{statement}'") as refused:
        read_closed_surface(obj(tmp_path / "a.obj", f"# by A. Patient, {statement}", box()))
    assert "Patient" not in str(refused.value)


def test_an_obj_that_counts_from_0_is_told(tmp_path: Path) -> None:
    file = obj(tmp_path / "a.obj", "#", box())
    text = file.read_text()
    lines = [
        "f " + " ".join(str(int(n) - 1) for n in line.split()[1:]) if line.startswith("f ") else line
        for line in text.splitlines()
    ]
    file.write_text("\n".join(lines))
    with pytest.raises(InputError, match="has a face that names vertex 0, but OBJ counts from 1"):
        read_closed_surface(file)
    file.write_text(text.replace("f 1 ", "f 1//0 ", 1))
    assert len(read_triangles(file)[1]) == box().n_cells, "a 0 that is no vertex's number is none of ours"


def test_a_folder_and_a_point_far_off_are_told(tmp_path: Path) -> None:
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(InputError, match=r"folder\.stl is a folder; give the path of a surface"):
        read_closed_surface(tmp_path / "folder.stl")
    mesh = box()
    mesh.points[5] = (0.0, 1e30, 0.0)
    with pytest.raises(InputError, match=r"has 1 of its \d+ points far off, up to 1e\+30 mm from the others"):
        read_closed_surface(stl(tmp_path / "far.stl", b"x", mesh))
    with pytest.raises(InputError, match="it may be in metres"):
        read_closed_surface(stl(tmp_path / "small.stl", b"x", box(1000.0)))
