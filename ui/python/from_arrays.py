"""Stiffness from arrays or pyvista meshes: no case folder, and nothing written."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TypeVar

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike, NDArray

from palpate.core.arrays import BoolArray, IntArray
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.errors import InputError
from palpate.core.files.json_types import typed
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.result_record import IdentificationRecord
from palpate.core.mesh import TetMesh
from palpate.core.problem import Facts, IdentificationProblem, SurfacePair
from palpate.core.residual.case_data import CaseData, arrays
from palpate.core.surfaces.surface import Surface
from palpate.core.worker.inline import run_inline
from palpate.core.worker.job import Job
from palpate.ui.python.checks import (
    any_array,
    check_closed,
    check_mesh,
    check_near,
    check_not_held,
    check_one_body,
    check_surface,
    numbers,
    positive,
    rising_bounds,
    search_options,
    whole_numbers,
)
from palpate.ui.python.findings import Gap, Stiffness

TISSUE = 3
# The model knows walls by these names. One that is not named is taken for the first.
WALLS = ("rectum", "bladder")
_WALL = WALLS[0]

Mesh = TetMesh | pv.UnstructuredGrid | tuple[ArrayLike, ArrayLike, ArrayLike]
Triangles = Surface | pv.PolyData | tuple[ArrayLike, ArrayLike]
Record = TypeVar("Record")


def identify(
    mesh: Mesh,
    *,
    rest: Triangles | None = None,
    deformed: Triangles,
    fixed: ArrayLike,
    driven: Mapping[str, tuple[ArrayLike, Triangles]] | tuple[ArrayLike, Triangles],
    tissue_G: float = 20.0,
    noise_sd_mm: float = Facts.noise_sd_mm,
    noise_correlation_mm: float = Facts.noise_correlation_mm,
    bounds_kpa: tuple[float, float] = (5.0, 500.0),
    method: str = "gauss-newton",
    **options: object,
) -> Stiffness:
    """Shear modulus of every organ region of a mesh that explains how its surface was deformed.

    mesh : tetrahedra at rest, mm: a pyvista grid with cell array "region", or points (n, 3), cells (m, 4), regions (m,); region 3
    is the surrounding tissue, every other one is looked for. rest, deformed : the organ's outer surface, triangles as a pyvista
    surface or points and faces; rest from the mesh where None. fixed : nodes (n,) that do not move. driven : nodes (n,) of a wall
    that is pushed, and the surface that it lies on after, normals into the tissue; several by the names "rectum" and "bladder".
    tissue_G : kPa; stiffness is relative to it. noise_sd_mm, noise_correlation_mm : of the deformed surface along its normal.
    options : further fields of `palpate.core.identify.options.IdentifyOptions`.

    Raises InputError for input that cannot be posed, ConvergenceError when nothing can be solved.
    """
    search = _options(method, options)
    facts = _facts(tissue_G, noise_sd_mm, noise_correlation_mm, bounds_kpa, search.law)
    problem = _problem(_tetrahedra(mesh), rest, deformed, fixed, driven, facts)
    asked = asdict(search)
    seed, workers = int(asked.pop("seed")), int(asked.pop("workers"))
    kind = "palpate.core.identify.job:run"
    return Stiffness(_answer(kind, "problem", problem.arrays(), asked, seed, workers, IdentificationRecord))


def diagnose(
    mesh: Mesh,
    *,
    rest: Triangles | None = None,
    deformed: Triangles,
    fixed: ArrayLike,
    driven: Mapping[str, tuple[ArrayLike, Triangles]] | tuple[ArrayLike, Triangles],
    tissue_G: float = 20.0,
    noise_sd_mm: float = Facts.noise_sd_mm,
    noise_correlation_mm: float = Facts.noise_correlation_mm,
    bounds_kpa: tuple[float, float] = (5.0, 500.0),
    method: str = "gauss-newton",
    **options: object,
) -> Gap:
    """Test of whether the model misses what the surfaces show beyond their noise, and of why. Arguments and errors are those
    of `identify`.

    Of `options` only `seed` and `law` matter here: a diagnosis has one element and one way to fit, whatever a search for the
    stiffness uses. The others are checked, so that one call's arguments serve both.
    """
    asked = _options(method, options)
    facts = _facts(tissue_G, noise_sd_mm, noise_correlation_mm, bounds_kpa, asked.law)
    problem = _problem(_tetrahedra(mesh), rest, deformed, fixed, driven, facts)
    of_job = {"case": "arrays", "effects": None, "numbers": DiagnosisOptions().to_json()}
    kind, given = "palpate.core.diagnose.job:run", arrays(CaseData(problem))
    return Gap(_answer(kind, "data", given, of_job, asked.seed, 1, DiagnosisRecord))


def _options(method: str, further: Mapping[str, object]) -> IdentifyOptions:
    return search_options({"method": method, "stiffness_map": False, **further}, "palpate.identify")


def _facts(tissue_G: float, noise_sd: float, correlation: float, bounds: tuple[float, float], law: str) -> Facts:
    G, sd, length = (
        positive(value, name)
        for value, name in ((tissue_G, "tissue_G"), (noise_sd, "noise_sd_mm"), (correlation, "noise_correlation_mm"))
    )
    return Facts(G, bounds_kpa=rising_bounds(bounds), noise_sd_mm=sd, noise_correlation_mm=length, organ_law=law)


def _answer(
    kind: str, role: str, given: Mapping[str, NDArray[np.generic]], options: Mapping[str, object], seed: int,
    workers: int, record: type[Record],
) -> Record:  # fmt: skip
    """Does a job in this process, its files in a folder that is removed."""
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        path = Path(folder, f"{role}.npz")
        np.savez(path, **given)  # type: ignore[arg-type]
        job = Job(kind, folder, {role: str(path)}, options, seed, workers)
        return typed(run_inline(job, lambda message: None), record, "the job's answer", "")


def _problem(
    mesh: TetMesh, rest: Triangles | None, deformed: Triangles, fixed: ArrayLike,
    driven: Mapping[str, tuple[ArrayLike, Triangles]] | tuple[ArrayLike, Triangles], facts: Facts,
) -> IdentificationProblem:  # fmt: skip
    organ = tuple(int(region) for region in np.unique(mesh.regions) if region != TISSUE)
    if not organ:
        raise InputError(f"the mesh has no region but {TISSUE}, the tissue; mark the organ's cells with another number")
    check_mesh(mesh)
    faces, owner = mesh.region_boundary(organ)
    in_mesh = Surface(mesh.points, faces, mesh.regions[owner])
    at_rest = in_mesh if rest is None else _closed(rest, organ[0], "rest")
    check_one_body(in_mesh, at_rest, ("in the mesh", "by its surface at rest"))
    after = _closed(deformed, organ[0], "deformed")
    check_one_body(at_rest, after)
    outer = mesh.boundary[0]
    held = _nodes(fixed, mesh, "fixed")
    boundary = {"bone": _faces_of(outer, held, "fixed")}
    walls = {}
    for name, (nodes, pushed) in _driven(driven).items():
        moved = _nodes(nodes, mesh, f"driven {name}")
        boundary[name] = _faces_of(outer, moved, f"driven {name}")
        check_not_held(outer, held, moved, name)
        # The wall's normals go into the tissue, those of the mesh's boundary out of it.
        wall = Surface(mesh.points, boundary[name][:, ::-1], np.full(len(boundary[name]), TISSUE))
        walls[name] = SurfacePair(wall, _surface(pushed, TISSUE, f"driven {name}"))
        check_near(wall, walls[name].deformed, f"driven {name}")
    names = {region: f"region_{region}" for region in organ}
    return IdentificationProblem(mesh, boundary, walls, SurfacePair(at_rest, after), facts, names)


def _driven(
    given: Mapping[str, tuple[ArrayLike, Triangles]] | tuple[ArrayLike, Triangles],
) -> Mapping[str, tuple[ArrayLike, Triangles]]:
    walls = given if isinstance(given, Mapping) else {_WALL: given}
    if not walls:
        raise InputError("driven names no wall: nothing would move; give (nodes, surface)")
    for name, pair in walls.items():
        if name not in WALLS or not isinstance(pair, tuple | list) or len(pair) != 2:
            raise InputError(f"driven {name!r}: give (nodes, surface), several by the names {' and '.join(WALLS)}")
    return walls


def _tetrahedra(mesh: Mesh) -> TetMesh:
    if isinstance(mesh, TetMesh):
        mesh = (mesh.points, mesh.cells, mesh.regions)
    if isinstance(mesh, pv.UnstructuredGrid):
        cells = {int(kind): corners for kind, corners in mesh.cells_dict.items()}.get(int(pv.CellType.TETRA))
        if cells is None or len(cells) != mesh.n_cells or "region" not in mesh.cell_data:
            raise InputError("the mesh must be of tetrahedra only, with a cell array 'region'")
        mesh = (mesh.points, cells, mesh.cell_data["region"])
    if not isinstance(mesh, tuple | list) or len(mesh) != 3:
        raise InputError("mesh: give a pyvista grid, or three arrays: points (n, 3), cells (m, 4) and regions (m,)")
    points, corners, regions = mesh
    return TetMesh(
        numbers(points, (None, 3), "mesh points"),
        whole_numbers(corners, (None, 4), "mesh cells"),
        whole_numbers(regions, (None,), "mesh regions"),
    )


def _surface(given: Triangles, region: int, what: str) -> Surface:
    """Triangles with outward normals; those of one region where none is given."""
    if isinstance(given, Surface):
        surface = given
    elif isinstance(given, pv.PolyData):
        three: pv.PolyData = given.triangulate()
        marked = three.cell_data["region"] if "region" in three.cell_data else np.full(three.n_cells, region)
        faces: IntArray = np.asarray(three.faces, dtype=np.int64).reshape(-1, 4)[:, 1:]
        surface = Surface(np.asarray(three.points, dtype=np.float64), faces, np.asarray(marked))
    elif isinstance(given, tuple | list) and len(given) == 2:
        corners = whole_numbers(given[1], (None, 3), f"{what} faces")
        surface = Surface(numbers(given[0], (None, 3), f"{what} points"), corners, np.full(len(corners), region))
    else:
        raise InputError(f"{what}: give a pyvista surface, or two arrays: points (n, 3) and faces (f, 3)")
    check_surface(surface, what)
    return surface


def _closed(given: Triangles, region: int, what: str) -> Surface:
    surface = _surface(given, region, what)
    check_closed(surface, what)
    return surface


def _nodes(given: ArrayLike, mesh: TetMesh, what: str) -> BoolArray:
    """A mask (n,) of nodes, from a mask or from their numbers."""
    array = any_array(given, what)
    if array.dtype == bool and array.shape == (len(mesh.points),):
        return np.asarray(array, dtype=np.bool_)
    if (
        array.dtype.kind not in "iu"
        or array.ndim != 1
        or not len(array)
        or array.min() < 0
        or array.max() >= len(mesh.points)
    ):
        raise InputError(f"{what}: give a mask of the mesh's {len(mesh.points)} nodes, or their numbers from 0")
    mask = np.zeros(len(mesh.points), dtype=bool)
    mask[array] = True
    return mask


def _faces_of(outer: IntArray, nodes: BoolArray, what: str) -> IntArray:
    """Outer faces whose corners are all among the nodes."""
    found = np.asarray(outer[nodes[outer].all(axis=1)])
    if not len(found):
        raise InputError(f"{what}: no outer face of the mesh has all its corners among these nodes")
    return found
