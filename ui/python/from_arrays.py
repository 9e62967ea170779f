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

from palpate.core.arrays import BoolArray, FloatArray, IntArray
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
from palpate.ui.python.findings import Gap, Stiffness

TISSUE = 3
# A wall that is not named is taken for this one: the model knows walls by these names.
_WALL = "rectum"

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
    noise_sd_mm: float = 0.4,
    noise_correlation_mm: float = 7.0,
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
    facts = _facts(tissue_G, noise_sd_mm, noise_correlation_mm, bounds_kpa)
    problem = _problem(_tetrahedra(mesh), rest, deformed, fixed, driven, facts)
    asked = asdict(IdentifyOptions(method=method, **{"stiffness_map": False, **options}))  # type: ignore[arg-type]
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
    noise_sd_mm: float = 0.4,
    noise_correlation_mm: float = 7.0,
    bounds_kpa: tuple[float, float] = (5.0, 500.0),
    method: str = "gauss-newton",
    **options: object,
) -> Gap:
    """Test of whether the model misses what the surfaces show beyond their noise, and of why. Arguments and errors are those
    of `identify`.

    Of `options` only `seed` matters here: a diagnosis has one element and one way to fit, whatever a search for the
    stiffness uses. The others are checked, so that one call's arguments serve both.
    """
    asked = IdentifyOptions(method=method, **options)  # type: ignore[arg-type]
    facts = _facts(tissue_G, noise_sd_mm, noise_correlation_mm, bounds_kpa)
    problem = _problem(_tetrahedra(mesh), rest, deformed, fixed, driven, facts)
    of_job = {"case": "arrays", "effects": None, "numbers": DiagnosisOptions().to_json()}
    kind, given = "palpate.core.diagnose.job:run", arrays(CaseData(problem))
    return Gap(_answer(kind, "data", given, of_job, asked.seed, 1, DiagnosisRecord))


def _facts(tissue_G: float, noise_sd: float, correlation: float, bounds: tuple[float, float]) -> Facts:
    for name, value in (("tissue_G", tissue_G), ("noise_sd_mm", noise_sd), ("noise_correlation_mm", correlation)):
        if not value > 0.0:
            raise InputError(f"{name} = {value} is not above 0")
    return Facts(tissue_G, bounds_kpa=bounds, noise_sd_mm=noise_sd, noise_correlation_mm=correlation)


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
    faces, owner = mesh.region_boundary(organ)
    at_rest = Surface(mesh.points, faces, mesh.regions[owner]) if rest is None else _surface(rest, organ[0])
    after = _surface(deformed, organ[0])
    outer = mesh.boundary[0]
    boundary = {"bone": _faces_of(outer, _nodes(fixed, mesh, "fixed"), "fixed")}
    walls = {}
    for name, (nodes, pushed) in (driven if isinstance(driven, Mapping) else {_WALL: driven}).items():
        boundary[name] = _faces_of(outer, _nodes(nodes, mesh, f"driven {name}"), f"driven {name}")
        # The wall's normals go into the tissue, those of the mesh's boundary out of it.
        wall = Surface(mesh.points, boundary[name][:, ::-1], np.full(len(boundary[name]), TISSUE))
        walls[name] = SurfacePair(wall, _surface(pushed, TISSUE))
    names = {region: f"region_{region}" for region in organ}
    return IdentificationProblem(mesh, boundary, walls, SurfacePair(at_rest, after), facts, names)


def _tetrahedra(mesh: Mesh) -> TetMesh:
    if isinstance(mesh, TetMesh):
        return mesh
    if isinstance(mesh, pv.UnstructuredGrid):
        cells = {int(kind): corners for kind, corners in mesh.cells_dict.items()}.get(int(pv.CellType.TETRA))
        if cells is None or len(cells) != mesh.n_cells or "region" not in mesh.cell_data:
            raise InputError("the mesh must be of tetrahedra only, with a cell array 'region'")
        return TetMesh(
            np.asarray(mesh.points, dtype=np.float64),
            np.asarray(cells, dtype=np.int64),
            np.asarray(mesh.cell_data["region"]),
        )
    points, corners, regions = mesh
    return TetMesh(np.asarray(points, dtype=np.float64), np.asarray(corners, dtype=np.int64), np.asarray(regions))


def _surface(given: Triangles, region: int) -> Surface:
    """Triangles with outward normals; those of one region where none is given."""
    if isinstance(given, Surface):
        return given
    if isinstance(given, pv.PolyData):
        three: pv.PolyData = given.triangulate()
        marked = three.cell_data["region"] if "region" in three.cell_data else np.full(three.n_cells, region)
        faces: IntArray = np.asarray(three.faces, dtype=np.int64).reshape(-1, 4)[:, 1:]
        return Surface(np.asarray(three.points, dtype=np.float64), faces, np.asarray(marked))
    points: FloatArray = np.asarray(given[0], dtype=np.float64)
    corners: IntArray = np.asarray(given[1], dtype=np.int64)
    return Surface(points, corners, np.full(len(corners), region))


def _nodes(given: ArrayLike, mesh: TetMesh, what: str) -> BoolArray:
    """A mask (n,) of nodes, from a mask or from their numbers."""
    array = np.asarray(given)
    if array.dtype == bool and array.shape == (len(mesh.points),):
        return array
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
