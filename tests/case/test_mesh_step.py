"""The mesh step on a case folder. The mesher itself is tested in test_meshing.py: here a stand-in takes its place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from voxel_shapes import ball, grid, paint, tube

from palpate.case import meshed as meshed_case
from palpate.case.case_folder import CaseFacts, CaseFolder, file_sha256
from palpate.case.steps import mesh as mesh_step
from palpate.case.steps.declarations import MESH
from palpate.core.errors import InputError
from palpate.core.mesh import TetMesh
from palpate.imaging.volume import Volume
from palpate.meshing.mesh_file import Recipe, recipe_hash
from palpate.meshing.mesh_labels import MeshedCase, MeshOptions

SHIFT_MM = 3.0


def state(shift_mm: float) -> Volume:
    """An organ of two halves in front of a rectum, moved to the front by ``shift_mm``."""
    labels = grid((1.5, 1.5, 2.0), (27.0, 27.0, 24.0), np.array([0.1, 0.2, 0.3]))
    labels = paint(labels.with_array(labels.array + 3), tube(6.0, y=18.0 - shift_mm, bend=0.0), 6)
    labels = paint(labels, ball(10.0, (0.0, -shift_mm, 0.0)), 1)
    x = labels.to_lps(np.indices(labels.array.shape).reshape(3, -1).T.astype(float))[:, 0]
    labels.array[(labels.array == 1) & (x < 0.0).reshape(labels.array.shape)] = 2
    return labels


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[MeshOptions]:
    """How often a mesh was made; each time another one, as the mesher does."""
    made: list[MeshOptions] = []

    def stand_in(labels: Volume, options: MeshOptions) -> MeshedCase:
        made.append(options)
        points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, len(made)]])
        mesh = TetMesh(points, np.array([[0, 1, 2, 3]]), np.array([1]))
        recipe = Recipe(labels, mesh_step.asdict(options))
        quality = {"cells": 1, "seconds": 0.0, "recipe_sha256": recipe_hash(recipe)}
        return MeshedCase(mesh, {"outer": mesh.boundary[0]}, quality)

    monkeypatch.setattr(mesh_step, "mesh_labels", stand_in)
    return made


@pytest.fixture
def case(tmp_path: Path) -> CaseFolder:
    case = CaseFolder.create(tmp_path / "case", CaseFacts.from_dict({"name": "step"}, "test"))
    case.write_labels("rest", state(0.0))
    case.write_labels("deformed", state(SHIFT_MM))
    return case


def test_files_and_figures(case: CaseFolder, calls: list[MeshOptions]) -> None:
    told: list[tuple[float, str]] = []
    report = mesh_step.run(case, progress=lambda fraction, message: told.append((fraction, message)))
    assert [fraction for fraction, _ in told] == sorted(fraction for fraction, _ in told)
    assert told[-1] == (1.0, "1 cells")
    assert all(case.has(name) for name in MESH.writes)
    assert report == case.read_json("mesh.json")
    assert report["mesh_sha256"] == file_sha256(case.file("mesh.npz"))
    view = pv.read(case.file("mesh.vtu"))
    assert view.n_cells == 1
    assert view.cell_data["region"][0] == 1
    meshed = meshed_case.load_meshed(case)
    assert set(meshed.boundary) == {"outer"}
    assert meshed.mesh.volumes.sum() == pytest.approx(1.0 / 6.0)


def test_surfaces_of_both_states(case: CaseFolder, calls: list[MeshOptions]) -> None:
    mesh_step.run(case)
    rest, deformed = (meshed_case.load_surfaces(case, name) for name in ("rest", "deformed"))
    assert set(rest) == set(deformed) == {"organ", "rectum"}
    assert rest["organ"].enclosed_volume == pytest.approx(4.0 / 3.0 * np.pi * 1000.0, rel=0.02)
    moved = deformed["organ"].points.mean(axis=0) - rest["organ"].points.mean(axis=0)
    assert moved == pytest.approx([0.0, -SHIFT_MM, 0.0], abs=0.15)
    rim = case.read_npz("surfaces.npz")["rest_organ_rim"]
    assert np.abs(rest["organ"].points[rim, 0]).max() < 1.6


def test_a_second_run_does_nothing(case: CaseFolder, calls: list[MeshOptions]) -> None:
    first = mesh_step.run(case)
    before = file_sha256(case.file("mesh.npz"))
    assert mesh_step.run(case) == first
    assert len(calls) == 1
    assert file_sha256(case.file("mesh.npz")) == before


def test_other_deformed_labels_keep_the_mesh(case: CaseFolder, calls: list[MeshOptions]) -> None:
    mesh_step.run(case)
    before = case.read_npz("mesh.npz")["points"]
    case.write_labels("deformed", state(2.0))
    mesh_step.run(case)
    assert len(calls) == 1
    assert np.array_equal(case.read_npz("mesh.npz")["points"], before)
    moved = meshed_case.load_surfaces(case, "deformed")["organ"].points.mean(axis=0)
    assert moved[1] == pytest.approx(-2.0, abs=0.15)


@pytest.mark.parametrize("change", ["options", "rest", "mesh file"])
def test_other_inputs_give_another_mesh(case: CaseFolder, calls: list[MeshOptions], change: str) -> None:
    mesh_step.run(case)
    options = MeshOptions(edge_mm=4.0) if change == "options" else None
    if change == "rest":
        case.write_labels("rest", state(1.0))
    if change == "mesh file":  # as after a kill between the two files, with the labels put back
        arrays: dict[str, Any] = case.read_npz("mesh.npz") | {"points": np.eye(4, 3)[:, ::-1]}
        case.write_npz("mesh.npz", **arrays)
        case.file("state.json").unlink()
    mesh_step.run(case, options)
    assert len(calls) == 2


def test_missing_labels_are_named(case: CaseFolder, calls: list[MeshOptions]) -> None:
    case.file("deformed.nii.gz").unlink()
    with pytest.raises(InputError, match=r"deformed\.nii\.gz is not there; run `palpate segment`"):
        mesh_step.run(case)
    assert not calls
