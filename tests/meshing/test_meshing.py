"""The mesh of a small pelvis made of analytic shapes."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from voxel_shapes import ball, distance, grid, paint, prostate, tube

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.mesh import FACES_OF_CELL
from palpate.imaging.volume import Volume
from palpate.meshing import mesh_labels as meshing
from palpate.meshing.cell_shape import dihedral_angles, radius_ratio
from palpate.meshing.cells import face_neighbours, parts_of
from palpate.meshing.mesh_labels import MeshedCase, MeshOptions, mesh_labels

SPACING = (1.2, 1.2, 2.0)
RECTUM = tube(7.0, y=21.5, bend=0.002)
BLADDER = ball(10.0, (2.0, -3.0, 21.0))
BONE = ball(11.0, (33.0, -12.0, -4.0))
OPTIONS = MeshOptions(target_tets=2000)


def small_prostate(points: FloatArray) -> FloatArray:
    """The prostate at 60 % of its size; it touches the bladder and comes within 3 mm of the rectum."""
    return prostate(points / 0.6) * 0.6


def pelvis() -> Volume:
    """Labels 0 to 6: organ divided at x = 1, bone and rectum running through the faces of the box."""
    labels = grid(SPACING, (38.0, 38.0, 36.0), np.array([0.3, -0.2, 0.5]))
    labels = labels.with_array(labels.array + 3)
    for shape, value in ((BONE, 4), (BLADDER, 5), (RECTUM, 6), (small_prostate, 1)):
        labels = paint(labels, shape, value)
    x = labels.to_lps(np.indices(labels.array.shape).reshape(3, -1).T.astype(float))[:, 0]
    labels.array[(labels.array == 1) & (x < 1.0).reshape(labels.array.shape)] = 2
    return labels.with_array(np.pad(labels.array[3:-3, 3:-3, 2:-2], ((3, 3), (3, 3), (2, 2))))


@pytest.fixture(scope="module")
def labels() -> Volume:
    return pelvis()


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("meshes")


@pytest.fixture(scope="module")
def meshed(labels: Volume, cache: Path) -> MeshedCase:
    return mesh_labels(labels, OPTIONS, cache)


def test_regions_have_the_volume_of_their_voxels(meshed: MeshedCase) -> None:
    errors = {region: figures["volume_error"] for region, figures in meshed.quality["regions"].items()}
    assert set(errors) == {"1", "2", "3"}
    assert max(abs(error) for error in errors.values()) < 0.02


def test_cells_are_in_shape_and_as_many_as_wanted(meshed: MeshedCase) -> None:
    angles = dihedral_angles(meshed.mesh.points, meshed.mesh.cells)
    assert angles.min() == pytest.approx(meshed.quality["min_dihedral_deg"])
    assert angles.min() > 9.0
    assert meshed.quality["slivers"] <= 1
    assert 0.65 < len(meshed.mesh.cells) / OPTIONS.target_tets < 1.5


def test_the_mesh_is_conforming_and_in_one_piece(meshed: MeshedCase) -> None:
    mesh = meshed.mesh
    _, counts = np.unique(np.sort(mesh.cells[:, FACES_OF_CELL].reshape(-1, 3), axis=1), axis=0, return_counts=True)
    assert counts.max() == 2
    across = face_neighbours(mesh.cells)
    for member in (mesh.regions > 0, mesh.regions == 1, mesh.regions == 2):
        assert parts_of(across, member).max() == 0
    assert len(np.unique(mesh.cells)) == len(mesh.points)


def test_boundary_names_cover_the_boundary_once(meshed: MeshedCase) -> None:
    named = np.concatenate(list(meshed.boundary.values()))
    whole, _ = meshed.mesh.boundary
    assert set(meshed.boundary) == {"bone", "bladder", "rectum", "outer"}
    assert {tuple(f) for f in np.sort(named, axis=1).tolist()} == {tuple(f) for f in np.sort(whole, axis=1).tolist()}
    assert len(named) == len(whole)
    # Outward faces of a closed surface enclose the volume of the mesh.
    a, b, c = (meshed.mesh.points[named[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 == pytest.approx(meshed.mesh.volumes.sum())


@pytest.mark.parametrize(("name", "shape"), [("rectum", RECTUM), ("bladder", BLADDER), ("bone", BONE)])
def test_walls_lie_on_the_shapes(meshed: MeshedCase, name: str, shape: object) -> None:
    faces = meshed.boundary[name]
    centres = meshed.mesh.points[faces].mean(axis=1)
    inside = (np.abs(centres) < [31.0, 31.0, 29.0]).all(axis=1)
    found = distance(shape, centres[inside])  # type: ignore[arg-type]
    # The mesher is not the same twice: a few vertices may stay where they would flatten a cell.
    assert np.percentile(np.abs(found), 95) < 1.4
    assert abs(found.mean()) < 0.45


def test_organ_surface_lies_on_the_organ_without_bias(meshed: MeshedCase) -> None:
    faces, _ = meshed.mesh.region_boundary((1, 2))
    points = meshed.mesh.points
    free = points[:, 2] < 8.0  # above it the bladder dents the organ
    keep = free[faces].all(axis=1)
    found = distance(small_prostate, points[faces[keep]].mean(axis=1))
    assert abs(found.mean()) < 0.15
    vertices = distance(small_prostate, points[np.unique(faces[keep])])
    # Vertices stand out a little, because the flat faces between them cut in: by a sixth of edge^2 / radius at most.
    assert np.percentile(np.abs(vertices), 95) < 1.7
    assert vertices.mean() > 0.0


def test_thin_tissue_between_organ_and_rectum_is_kept(meshed: MeshedCase) -> None:
    organ, _ = meshed.mesh.region_boundary((1, 2))
    touching = {tuple(f) for f in np.sort(organ, axis=1).tolist()}
    rectum = {tuple(f) for f in np.sort(meshed.boundary["rectum"], axis=1).tolist()}
    bladder = {tuple(f) for f in np.sort(meshed.boundary["bladder"], axis=1).tolist()}
    assert not touching & rectum
    # The bladder does touch the organ, and there the organ's face is the bladder's.
    assert len(touching & bladder) > 5


def test_the_cache_gives_the_same_mesh(labels: Volume, cache: Path, meshed: MeshedCase) -> None:
    again = mesh_labels(labels, OPTIONS, cache)
    assert np.array_equal(again.mesh.points, meshed.mesh.points)
    assert np.array_equal(again.mesh.cells, meshed.mesh.cells)
    assert again.quality == meshed.quality
    assert all(np.array_equal(again.boundary[name], faces) for name, faces in meshed.boundary.items())
    assert len(list(cache.iterdir())) == 1


def test_other_labels_are_not_taken_from_the_cache(labels: Volume, cache: Path, meshed: MeshedCase) -> None:
    mirrored = labels.with_array(np.where(labels.array == 1, 2, np.where(labels.array == 2, 1, labels.array)))
    keys = {
        meshing.recipe_hash(meshing.Recipe(volume, {"options": options}))
        for volume, options in ((labels, 1), (mirrored, 1), (labels, 2), (labels.moved(np.diag([1.0, 1, 1, 1])), 1))
    }
    assert len(keys) == 3


def test_a_mesher_that_dies_is_told_in_one_line(labels: Volume, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("palpate.meshing.tetwild.sys.executable", "/bin/false")
    with pytest.raises(ConvergenceError, match="the mesher ended with status 1"):
        mesh_labels(labels, MeshOptions(edge_mm=9.0))


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a process with the one that started it")
def test_the_mesher_ends_with_a_killed_program() -> None:
    child = "import os, time; from palpate.meshing import tetwild; tetwild._die_with_parent(); "
    child += "print(os.getpid(), flush=True); time.sleep(60)"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    with subprocess.Popen([sys.executable, "-c", parent], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        mesher = Path("/proc", program.stdout.readline().strip(), "stat")
        program.kill()
    deadline = time.monotonic() + 10.0
    # A dead process may stay listed as a zombie until somebody asks for its status.
    while mesher.exists() and ") Z " not in mesher.read_text():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_one_region_without_bladder_and_rectum(capfd: pytest.CaptureFixture[str]) -> None:
    labels = grid(SPACING, (24.0, 24.0, 24.0), np.zeros(3))
    labels = paint(labels.with_array(labels.array + 3), small_prostate, 1)
    found = mesh_labels(labels, MeshOptions(edge_mm=7.0))
    # The mesher writes from C++; none of it may reach the standard output that --json needs.
    assert capfd.readouterr() == ("", "")
    assert set(found.mesh.regions) == {1, 3}
    assert set(found.boundary) == {"outer"}
    # The labels run to the end of the grid, 25 mm: the mesh ends there too, within half an edge; the outer surface is not fitted.
    reach = np.abs(found.mesh.points).max(axis=1)
    assert reach.max() < 25.0 + 3.5
    assert np.percentile(reach, 95.0) < 27.0
    assert found.quality["regions"]["3"]["volume_error"] == pytest.approx(0.0, abs=0.03)


def test_labels_without_organ_are_refused(labels: Volume) -> None:
    with pytest.raises(InputError, match="no organ voxel"):
        mesh_labels(labels.with_array(np.where(labels.array < 3, 3, labels.array)))


def test_labels_without_tissue_are_refused(labels: Volume) -> None:
    with pytest.raises(InputError, match="no surrounding tissue"):
        mesh_labels(labels.with_array(np.where(labels.array == 3, 0, labels.array)))


def test_an_organ_at_the_edge_is_refused(labels: Volume) -> None:
    cut = Volume(labels.array[:, :, : labels.array.shape[2] // 2], labels.affine)
    with pytest.raises(InputError, match="touches the edge of the modelled region"):
        mesh_labels(cut)


def test_measures_of_known_cells() -> None:
    regular = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    cell = np.array([[0, 1, 2, 3]])
    assert dihedral_angles(regular, cell) == pytest.approx(np.full((1, 6), np.degrees(np.arccos(1.0 / 3.0))))
    assert radius_ratio(regular, cell) == pytest.approx(1.0)
    assert np.sort(dihedral_angles(corner, cell))[0, 3:] == pytest.approx(90.0)
    # Inscribed radius 1 / (3 + sqrt 3), circumscribed sqrt(3) / 2.
    assert radius_ratio(corner, cell) == pytest.approx(3.0 / (3.0 + np.sqrt(3.0)) / (np.sqrt(3.0) / 2.0))
