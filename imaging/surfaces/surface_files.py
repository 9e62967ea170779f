"""Closed surfaces from STL, OBJ and PLY files: read, mended where that changes nothing, refused where it would."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyvista as pv

from palpate.core.errors import InputError
from palpate.core.surfaces.surface import Surface
from palpate.core.surfaces.triangles import enclosed_volume
from palpate.imaging.surfaces.ply import read_ply
from palpate.imaging.surfaces.self_intersections import crossings
from palpate.imaging.surfaces.stated_frame import stated_frame
from palpate.imaging.surfaces.triangle_files import read_triangles

SUFFIXES = (".stl", ".obj", ".ply")
# Extents, mm, beyond which a surface is hardly in mm.
SMALLEST_MM, LARGEST_MM = 4.0, 1000.0
# Shares of the extent: points nearer than the first are one; holes narrower than the second are closed.
_SAME, _HOLE = 1e-5, 0.05
# Parts with less than this share of the largest one's area are specks.
_SPECK = 0.01
# At most this share of the points are damaged numbers, and these lie this many times as far away as the rest.
_DAMAGED, _FAR = 0.1, 100.0
_MOST_FACES = 4_000_000


@dataclass(frozen=True, eq=False)
class ReadSurface:
    """surface : closed, normals outwards. notes : what was mended, one line each."""

    surface: Surface
    notes: tuple[str, ...]


def read_closed_surface(path: Path) -> ReadSurface:
    """The one closed surface of an STL, OBJ or PLY file, in mm.

    Joins coincident points, drops specks, closes narrow holes, turns faces outwards and says so. Raises InputError naming the
    file when it holds no surface, several, one with a wide hole, one that crosses itself or branches, or one not in mm.
    """
    notes: list[str] = []
    mesh = _joined(_read(path, notes), notes)
    size = _extent(mesh, path)
    mesh = _one_body(mesh, path, notes)
    mesh = _closed(mesh, size, path, notes)
    points, faces = _arrays(mesh)
    faces = _outward(points, faces, path, notes)
    _refuse_crossings(points, faces, path)
    return ReadSurface(Surface(points, faces, np.ones(len(faces), dtype=np.int64)), tuple(notes))


def _read(path: Path, notes: list[str]) -> pv.PolyData:
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the path of a surface (STL, OBJ or PLY)")
    if not path.is_file():
        raise InputError(f"{path} is not there; give the path of a surface (STL, OBJ or PLY)")
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path} is no STL, OBJ or PLY file; save the surface in one of these forms")
    points, faces = read_ply(path) if path.suffix.lower() == ".ply" else read_triangles(path)
    mesh = pv.PolyData.from_regular_faces(points, faces.astype(int)) if len(faces) else pv.PolyData()
    if mesh.n_points == 0 or mesh.n_cells == 0:
        raise InputError(f"{path} holds no surface; save the closed surface of the organ again")
    if mesh.n_cells > _MOST_FACES:
        raise InputError(f"{path} has {mesh.n_cells} faces; {_MOST_FACES} is the most: simplify it")
    if not np.isfinite(mesh.points).all():
        raise InputError(f"{path} has points that are not finite; save it again")
    frame = stated_frame(path)
    notes += frame.notes
    mesh = pv.PolyData(frame.in_lps_mm(mesh.points.astype(np.float64)), faces=mesh.faces).triangulate()
    _refuse_far_points(mesh, path)
    return mesh


def _refuse_far_points(mesh: pv.PolyData, path: Path) -> None:
    """A damaged number: beside it the whole body would be one point."""
    points = mesh.points[np.unique(mesh.regular_faces)]
    away = np.abs(points - np.median(points, axis=0)).max(axis=1)
    # The body's own size, in which single numbers that are wrong take no part.
    body = float(np.quantile(away, 1.0 - _DAMAGED))
    far = away > max(LARGEST_MM, _FAR * body)
    if far.any():
        raise InputError(
            f"{path} has {int(far.sum())} of its {len(points)} points far off, up to {away.max():.3g} mm from the others; remove them"
        )


def _joined(mesh: pv.PolyData, notes: list[str]) -> pv.PolyData:
    """Coincident points joined, faces of no area dropped."""
    before, extent = mesh.n_points, float(np.ptp(mesh.points, axis=0).max())
    joined = mesh.clean(tolerance=_SAME * extent, absolute=True)
    if joined.n_points < before:
        notes.append(f"{before - joined.n_points} points that coincide with others were joined")
    return (
        pv.PolyData.from_regular_faces(joined.points, joined.regular_faces)
        if joined.GetNumberOfPolys()
        else pv.PolyData()
    )


def _extent(mesh: pv.PolyData, path: Path) -> float:
    if mesh.n_cells == 0:
        raise InputError(f"{path} holds no surface: all its faces are points or lines; save it again")
    size = float(np.ptp(mesh.points, axis=0).max())
    if not SMALLEST_MM <= size <= LARGEST_MM:
        raise InputError(
            f"{path} is {size:.3g} mm across; {SMALLEST_MM:g} to {LARGEST_MM:g} mm is what can be: it may be in metres, "
            "inches or without a scale; save it in mm"
        )
    return size


def _one_body(mesh: pv.PolyData, path: Path, notes: list[str]) -> pv.PolyData:
    parts = mesh.connectivity("all")
    number = np.asarray(parts.cell_data["RegionId"])
    areas = np.bincount(number, np.abs(mesh.compute_cell_sizes(length=False, volume=False)["Area"]))
    large = areas >= _SPECK * areas.max()
    if large.sum() > 1:
        raise InputError(f"{path} holds {int(large.sum())} separate surfaces; save one closed surface of one body")
    if len(areas) > 1:
        notes.append(f"{len(areas) - 1} loose specks were left out")
        mesh = pv.PolyData.from_regular_faces(mesh.points, mesh.regular_faces[number == areas.argmax()]).clean()
    return mesh


def _closed(mesh: pv.PolyData, size: float, path: Path, notes: list[str]) -> pv.PolyData:
    rims = _edges(mesh, boundary=True)
    if rims.n_cells:
        rims = rims.connectivity("all")
        number = np.asarray(rims.point_data["RegionId"])
        widths = [float(np.ptp(rims.points[number == k], axis=0).max()) for k in range(number.max() + 1)]
        if max(widths) > _HOLE * size:
            raise InputError(
                f"{path} has a hole {max(widths):.3g} mm wide ({len(widths)} open rims in all); up to {_HOLE * size:.2g} mm "
                "are closed here, this one close in the program that made the surface"
            )
        mesh = mesh.fill_holes(size).triangulate()
        notes.append(f"{len(widths)} holes of up to {max(widths):.2g} mm were closed")
    if mesh.n_open_edges or _edges(mesh, non_manifold=True).n_cells:
        raise InputError(f"{path} is not the surface of a solid: edges are open or have three faces; mend it")
    return mesh


def _edges(mesh: pv.PolyData, boundary: bool = False, non_manifold: bool = False) -> pv.PolyData:
    return mesh.extract_feature_edges(
        boundary_edges=boundary, non_manifold_edges=non_manifold, feature_edges=False, manifold_edges=False
    )


def _outward(points: np.ndarray, faces: np.ndarray, path: Path, notes: list[str]) -> np.ndarray:
    """Faces (f, 3) that agree with their neighbours and look outwards."""
    turned = pv.PolyData.from_regular_faces(points, faces).compute_normals(
        cell_normals=True, point_normals=False, split_vertices=False, consistent_normals=True, non_manifold_traversal=False
    )  # fmt: skip
    out = np.asarray(turned.regular_faces, dtype=np.int64)
    volume = enclosed_volume(points, out)
    if abs(volume) < 1e-6 * float(np.ptp(points, axis=0).max()) ** 3:
        raise InputError(f"{path} encloses no volume; give the closed surface of a body")
    if volume < 0.0:
        out = out[:, ::-1].copy()
    flipped = int((np.sort(out, axis=1) != np.sort(faces, axis=1)).any()) or int((_handed(out) != _handed(faces)).sum())
    if flipped:
        notes.append(f"{flipped} faces that looked inwards were turned")
    return out


def _handed(faces: np.ndarray) -> np.ndarray:
    """(f,) whether a face goes round from its lowest point to the next higher one first."""
    first = faces.argmin(axis=1)
    turned = np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)
    return turned[:, 1] < turned[:, 2]


def _refuse_crossings(points: np.ndarray, faces: np.ndarray, path: Path) -> None:
    found = crossings(points, faces)
    if found is not None and len(found):
        x, y, z = points[faces[found[0]]].mean(axis=0)
        raise InputError(
            f"{path} crosses itself in {len(found)} faces, first near ({x:.1f}, {y:.1f}, {z:.1f}) mm; mend it in the program "
            "that made it"
        )


def _arrays(mesh: pv.PolyData) -> tuple[np.ndarray, np.ndarray]:
    mesh = mesh.clean(point_merging=False)
    return np.asarray(mesh.points, dtype=np.float64), np.asarray(mesh.regular_faces, dtype=np.int64)
