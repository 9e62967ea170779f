"""Checks of what is given from Python: the same as of a case's files, and of arrays, which have no file to be checked."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.files.json_types import typed_strictly
from palpate.core.identify.options import IdentifyOptions
from palpate.core.mesh import TetMesh
from palpate.core.surfaces.surface import Surface
from palpate.imaging.surfaces.self_intersections import crossings
from palpate.imaging.surfaces.surface_files import LARGEST_MM, SMALLEST_MM

# As those of case.json (`case_facts`), kPa.
_MODULI = (1e-3, 1e6)
# The deformed organ's centre lies within this many of its own sizes from where it was, and none of two sizes is this many times the other.
# Chosen: no organ moves by its own size; a factor of ten is a wrong unit.
_FAR = 3.0


def any_array(given: ArrayLike, what: str) -> NDArray[np.generic]:
    """An array. Raises InputError where the rows have several lengths."""
    try:
        return np.asarray(given)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} is no array of numbers") from error


def numbers(given: ArrayLike, shape: tuple[int | None, ...], what: str) -> FloatArray:
    """Finite numbers of a shape, None where any length is. Raises InputError, for text too."""
    array = any_array(given, what)
    fits = array.ndim == len(shape) and all(n in (None, have) for n, have in zip(shape, array.shape, strict=True))
    if not fits or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        wanted = ", ".join("n" if n is None else str(n) for n in shape)
        raise InputError(
            f"{what}: finite numbers of shape ({wanted}) are needed, not {array.dtype} of shape {array.shape}"
        )
    return np.asarray(array, dtype=np.float64)


def whole_numbers(given: ArrayLike, shape: tuple[int | None, ...], what: str) -> IntArray:
    """As `numbers`; 2.0 is whole, 1.5 is refused."""
    array = numbers(given, shape, what)
    wrong = (array != np.rint(array)) | (np.abs(array) > 2.0**53)
    if wrong.any():
        raise InputError(f"{what}: {array[wrong].flat[0]:g} is no whole number")
    return array.astype(np.int64)


def positive(value: float, name: str) -> float:
    """A finite number above 0. Raises InputError."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.integer | np.floating):
        raise InputError(f"{name} is {value!r}; it must be a number above 0")
    if not value > 0.0:
        raise InputError(f"{name} = {value} is not above 0")
    if not np.isfinite(value):
        raise InputError(f"{name} = {value} is not finite")
    return float(value)


def whole(value: int, name: str, least: int) -> int:
    """A whole number of at least ``least``. Raises InputError."""
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(f"{name} is {value!r}; it must be a whole number of at least {least}")
    return int(value)


def truth(value: bool, name: str) -> bool:
    """True or false. Raises InputError."""
    if not isinstance(value, bool | np.bool_):
        raise InputError(f"{name} is {value!r}; it must be True or False")
    return bool(value)


def path_of(given: str | Path, name: str) -> Path:
    """A path. Raises InputError for what is none, or holds the character 0."""
    if not isinstance(given, str | Path) or not str(given) or "\0" in str(given):
        raise InputError(f"{name} is {given!r}; give a path")
    return Path(given)


def search_options(given: Mapping[str, object], whose: str) -> IdentifyOptions:
    """Options by their names; numbers of NumPy too. Raises InputError for one that is unknown or of another type."""
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in given.items()}
    return typed_strictly(plain, IdentifyOptions, f"the options of {whose}", "")


def rising_bounds(given: tuple[float, float]) -> tuple[float, float]:
    """Bounds of the stiffness, kPa, as case.json has them. Raises InputError."""
    low, high = numbers(given, (2,), "bounds_kpa")
    if not _MODULI[0] <= low < high <= _MODULI[1]:
        raise InputError(
            f"bounds_kpa is ({low:g}, {high:g}); two rising numbers above 0, from {_MODULI[0]:g} to {_MODULI[1]:g}, are needed"
        )
    return float(low), float(high)


def check_mesh(mesh: TetMesh) -> None:
    """Raises InputError where a mesh is hardly in mm, or falls into pieces."""
    _check_extent(mesh.points[np.unique(mesh.cells)], "mesh")
    ends = mesh.cells[:, [1, 2, 3]].ravel(), np.repeat(mesh.cells[:, 0], 3)
    n = len(mesh.points)
    _, piece = connected_components(coo_array((np.ones(len(ends[0])), ends), shape=(n, n)), directed=False)
    pieces = len(np.unique(piece[np.unique(mesh.cells)]))
    if pieces > 1:
        twice = n - len(np.unique(mesh.points, axis=0))
        merge = f": merge the {twice} points that coincide with others" if twice else "; give one connected mesh"
        raise InputError(f"the mesh falls into {pieces} pieces that share no point{merge}")


def check_surface(surface: Surface, what: str) -> None:
    """Raises InputError where a surface has no faces, one that names no point, or is hardly in mm."""
    points, faces = surface.points, surface.faces
    if len(faces) == 0:
        raise InputError(f"{what} has no faces")
    if faces.min() < 0 or faces.max() >= len(points):
        raise InputError(f"{what} has a face that names a point which does not exist; points are counted from 0")
    if not np.isfinite(points).all():
        raise InputError(f"{what} has points that are not finite")
    _check_extent(points[np.unique(faces)], what)


def check_closed(surface: Surface, what: str) -> None:
    """Raises InputError where an organ's surface is not closed, not in one piece, or looks inwards."""
    edges = surface.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, counts = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    if (counts == 1).any() or (counts % 2).any():
        raise InputError(
            f"{what} is not closed: {int((counts % 2).sum())} edges have no second face; are its points counted from 0?"
        )
    n = len(surface.points)
    _, piece = connected_components(coo_array((np.ones(len(edges)), edges.T), shape=(n, n)), directed=False)
    pieces = len(np.unique(piece[surface.faces]))
    if pieces > 1:
        raise InputError(f"{what} holds {pieces} separate surfaces; give one closed surface of one body")
    through = crossings(surface.points, surface.faces)
    if through is not None and len(through):
        raise InputError(
            f"{what} is no closed surface of a body: it crosses itself in {len(through)} faces; are its points counted from 0?"
        )
    if surface.enclosed_volume <= 0.0:
        raise InputError(f"{what} encloses {surface.enclosed_volume:.3g} mm3: its faces look inwards; turn them")


def check_one_body(rest: Surface, deformed: Surface, states: tuple[str, str] = ("at rest", "deformed")) -> None:
    """Raises InputError where two surfaces are so unlike, or so far apart, that they are hardly one organ. states : of each."""
    ends = [_corners(surface) for surface in (rest, deformed)]
    sizes = [float(np.ptp(points, axis=0).max()) for points in ends]
    if max(sizes) > _FAR * min(sizes):
        raise InputError(
            f"the organ is {sizes[0]:.3g} mm across {states[0]} and {sizes[1]:.3g} mm {states[1]}: are both in mm?"
        )
    check_near(rest, deformed, f"the organ {states[1]}", states[0])


def check_near(before: Surface, after: Surface, what: str, where: str = "at rest") -> None:
    """Raises InputError where a surface lies so far from what it was that both are hardly in one frame."""
    ends = [_corners(surface) for surface in (before, after)]
    away = float(np.linalg.norm(ends[1].mean(axis=0) - ends[0].mean(axis=0)))
    if away > _FAR * float(np.ptp(ends[0], axis=0).max()):
        raise InputError(f"{what} lies {away:.3g} mm from where it is {where}: are both in one frame?")


def check_not_held(outer: IntArray, held: BoolArray, moved: BoolArray, name: str) -> None:
    """Raises InputError where faces of the mesh are held and driven at once."""
    both = int((held[outer].all(axis=1) & moved[outer].all(axis=1)).sum())
    if both:
        raise InputError(f"fixed and driven {name} share {both} faces: they cannot be held and moved at once")


def _corners(surface: Surface) -> FloatArray:
    return surface.points[np.unique(surface.faces)]


def _check_extent(points: FloatArray, what: str) -> None:
    size = float(np.ptp(points, axis=0).max())
    if not SMALLEST_MM <= size <= LARGEST_MM:
        raise InputError(
            f"{what} is {size:.3g} mm across; {SMALLEST_MM:g} to {LARGEST_MM:g} mm is what can be: is it in mm?"
        )
