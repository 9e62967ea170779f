"""One conforming tetrahedral mesh of organ and tissue from a label volume."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import FACES_OF_CELL, TetMesh
from palpate.imaging.labels import OUTSIDE
from palpate.imaging.volume import Volume
from palpate.meshing.cells import KEPT, clean_labels, face_neighbours, label_cells
from palpate.meshing.improve import improve_cells, tangent_limits
from palpate.meshing.interface_fit import FLOOR_DEG, Interface, fit_interfaces, interface_report, interfaces_of
from palpate.meshing.mesh_file import Recipe, load_mesh, recipe_hash, save_mesh
from palpate.meshing.mesh_options import MeshOptions
from palpate.meshing.mesher_input import make_scene
from palpate.meshing.partition import HOLE_NAMES, Partition, make_partition
from palpate.meshing.quality import MeshQuality, describe
from palpate.meshing.tetwild import tetrahedralize

# Meshed again, once, when the number of cells is further from what is wanted than this factor.
COUNT_TOLERANCE = 1.3
EDGE_POWER = 2.4
# Share of the organ's edge by which the last round of improvement may move a vertex off its surface.
LAST_SLACK = 0.06


# A mesh is made again, so often at most, when a region's volume differs by more than this from its labels', or a surface that
# data are read from is off, in the mean or rms, by more than these shares of the organ's edge (usual are 0.02 and 0.06).
GOOD_VOLUME, GOOD_MEAN, GOOD_RMS = 0.015, 0.05, 0.12
READ_SURFACES = ("organ", "bladder", "rectum")
MESH_ATTEMPTS = 4
_SEEDS_APART = 100


@dataclass(frozen=True, eq=False)
class MeshedCase:
    """A mesh of the organ (regions 1, 2) and the tissue (3), and what its boundary touches.

    boundary : name ("bone", "bladder", "rectum", "outer") -> faces (f, 3), normals out of the mesh; a name that touches
    nothing is absent. quality : figures, ready for JSON.
    """

    mesh: TetMesh
    boundary: dict[str, IntArray]
    quality: MeshQuality = field(default_factory=MeshQuality)


def mesh_labels(labels: Volume, options: MeshOptions | None = None, cache: Path | None = None) -> MeshedCase:
    """Mesh the labels 1, 2, 3 of a volume; bone, bladder, rectum and outside are holes.

    cache : folder in which meshes are kept under the hash of labels and options. On Linux the mesher makes the same mesh of the
    same input; elsewhere it needs a cache for that.

    Raises InputError when the labels cannot be meshed, ConvergenceError when the mesher fails.
    """
    options = options or MeshOptions()
    recipe = Recipe(labels, asdict(options))
    kept = None if cache is None else cache / f"{recipe_hash(recipe)}.npz"
    if kept is not None and kept.exists():
        return MeshedCase(*load_mesh(kept))
    start = time.perf_counter()
    partition = make_partition(labels)
    mesh, boundary, quality = _best_of(labels, partition, options)
    quality |= {"seconds": time.perf_counter() - start, "recipe_sha256": recipe_hash(recipe)}
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        save_mesh(kept, mesh, boundary, quality)
    return MeshedCase(mesh, boundary, quality)


def _best_of(
    labels: Volume, partition: Partition, options: MeshOptions
) -> tuple[TetMesh, dict[str, IntArray], MeshQuality]:
    """The first mesh that keeps to its labels, or the best of a few with other random numbers."""
    best: tuple[float, tuple[TetMesh, dict[str, IntArray], MeshQuality]] | None = None
    for attempt in range(1, MESH_ATTEMPTS + 1):
        points, cells, edge_mm = _mesh_to_count(partition, options, options.seed * _SEEDS_APART + attempt)
        points, cell_labels, surfaces = _fitted(points, cells, partition, edge_mm)
        mesh, boundary = assemble(points, cells, cell_labels)
        quality = describe(mesh, labels) | {
            "edge_mm": edge_mm,
            "surfaces": {name: interface_report(points, surface) for name, surface in surfaces.items()},
            "attempts": attempt,
        }
        error = _error(quality)
        if best is None or error < best[0]:
            best = error, (mesh, boundary, quality)
        if error < 1.0:
            break
    assert best is not None
    return best[1]


def _error(quality: MeshQuality) -> float:
    """How far a mesh is from its labels; 1 is the most that is taken at once."""
    volumes = [abs(figures["volume_error"]) / GOOD_VOLUME for figures in quality["regions"].values()]
    read = [quality["surfaces"][name] for name in READ_SURFACES if name in quality["surfaces"]]
    edge = quality["edge_mm"]
    means = [abs(figures["mean_mm"]) / (GOOD_MEAN * edge) for figures in read]
    return float(max(volumes + means + [figures["rms_mm"] / (GOOD_RMS * edge) for figures in read]))


def assemble(points: FloatArray, cells: IntArray, cell_labels: IntArray) -> tuple[TetMesh, dict[str, IntArray]]:
    """The mesh of the kept labels and its boundary by the label behind each face."""
    across = face_neighbours(cells)
    kept = np.isin(cell_labels, KEPT)
    used, renumbered = np.unique(cells[kept], return_inverse=True)
    mesh = TetMesh(points[used], renumbered.reshape(-1, 4), cell_labels[kept])
    beyond = np.where(across[kept] >= 0, cell_labels[across[kept]], OUTSIDE)
    faces = mesh.cells[:, FACES_OF_CELL]
    names = HOLE_NAMES | {OUTSIDE: "outer"}
    return mesh, {name: faces[beyond == label] for label, name in names.items() if (beyond == label).any()}


def _mesh_to_count(partition: Partition, options: MeshOptions, seed: int) -> tuple[FloatArray, IntArray, float]:
    """Points, cells and organ edge of the mesh whose kept cells are about as many as wanted."""
    scene = make_scene(partition)
    grows = options.far_factor, options.grading
    edge = options.edge_mm or scene.edge_for(options.target_tets, *grows)
    points, cells = tetrahedralize(replace(scene.soup(edge, *grows), seed=seed))
    excess = np.isin(label_cells(points, cells, partition), KEPT).sum() / options.target_tets
    if options.edge_mm is None and not 1.0 / COUNT_TOLERANCE < excess < COUNT_TOLERANCE:
        edge *= excess ** (1.0 / EDGE_POWER)
        points, cells = tetrahedralize(replace(scene.soup(edge, *grows), seed=seed))
    return points, cells, edge


def _fitted(
    points: FloatArray, cells: IntArray, partition: Partition, edge_mm: float
) -> tuple[FloatArray, IntArray, dict[str, Interface]]:
    """Points moved onto the smooth surfaces, the label of each cell, and the interfaces."""
    labels = clean_labels(cells, label_cells(points, cells, partition), len(points))
    points = fit_interfaces(points, cells, list(interfaces_of(cells, labels, partition).values()))
    # Asked again after the first fit: a flat cell on a surface may now lie on its other side.
    labels = clean_labels(cells, label_cells(points, cells, partition), len(points))
    surfaces = interfaces_of(cells, labels, partition)
    guarded = cells[np.isin(labels, KEPT)]
    points = fit_interfaces(points, guarded, list(surfaces.values()))
    for _ in range(2):
        points = improve_cells(points, guarded, tangent_limits(points, cells, labels))
        points = fit_interfaces(points, guarded, list(surfaces.values()), rounds=1)
    # What is flat still is held so by its surfaces: a few vertices may leave theirs a little.
    limits = tangent_limits(points, cells, labels)
    points = improve_cells(points, guarded, limits, wanted_deg=FLOOR_DEG, slack_mm=LAST_SLACK * edge_mm)
    return points, labels, surfaces
