"""Scans that nobody has aligned: one that lies elsewhere as a whole is laid on its bones, and nothing else is."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from schemas import check_form
from scipy.spatial.transform import Rotation
from voxel_shapes import Shape, ball, grid, paint, tube

from palpate.case.case_folder import CaseFacts, CaseFolder
from palpate.case.deformed_states import state_labels, state_landmarks
from palpate.case.problem import problem_of
from palpate.case.rigid_offset import rigid_offset_between
from palpate.case.stated_files import further_states
from palpate.case.steps import diagnose
from palpate.case.steps import mesh as mesh_step
from palpate.core.arrays import FloatArray
from palpate.core.files.json_types import plain
from palpate.core.mesh import TetMesh
from palpate.imaging.volume import Volume
from palpate.meshing.mesh_labels import MeshedCase, MeshOptions

ELSEWHERE = np.eye(4)
ELSEWHERE[:3, :3] = Rotation.from_euler("xyz", [4.0, -3.0, 6.0], degrees=True).as_matrix()
ELSEWHERE[:3, 3] = [4.0, -3.0, 2.0]
MARK = np.array([[3.0, -4.0, 5.0]])


def pelvis(filled_mm: float = 0.0, bones_mm: float = 0.0, edge_mm: float = 36.0) -> Volume:
    """Two halves in front of a rectum, with unlike bones on both sides, in a ball of tissue."""
    labels = paint(grid((2.0, 2.0, 2.0), (44.0, 44.0, 44.0), np.zeros(3)), ball(edge_mm, (0.0, 0.0, 0.0)), 3)
    labels = paint(labels, tube(6.0 + filled_mm, y=18.0, bend=0.0), 6)
    for half, at in (
        ((5.0, 9.0, 14.0), (24.0, -2.0, 4.0)),
        ((4.0, 12.0, 8.0), (-25.0, 2.0, -4.0)),
        ((11.0, 4.0, 5.0), (4.0, -27.0, -8.0)),
    ):
        labels = paint(labels, block(half, (at[0] + bones_mm, at[1], at[2] - bones_mm)), 4)
    labels = paint(labels, ball(11.0, (0.0, -3.0 - filled_mm, 0.0)), 1)
    x = labels.to_lps(np.indices(labels.array.shape).reshape(3, -1).T.astype(float))[:, 0]
    labels.array[(labels.array == 1) & (x < 0.0).reshape(labels.array.shape)] = 2
    return labels


def block(half: tuple[float, float, float], centre: tuple[float, float, float]) -> Shape:
    return lambda points: np.abs((points - np.array(centre)) / half).max(axis=-1) - 1.0


def by(matrix: FloatArray, points: FloatArray) -> FloatArray:
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3])


def middle(labels: Volume) -> FloatArray:
    """Of the organ."""
    return np.asarray(labels.to_lps(np.argwhere(np.isin(labels.array, (1, 2)))).mean(axis=0))


def make_case(folder: Path, deformed: Volume, marks: FloatArray, **facts: object) -> CaseFolder:
    case = CaseFolder.create(folder, CaseFacts.from_dict({"name": "made by hand", **facts}, "test"))
    case.write_labels("rest", pelvis())
    case.write_labels("deformed", deformed)
    case.write_text("landmarks.csv", marked(marks))
    return case


def marked(deformed: FloatArray) -> str:
    head = "name,rest_x,rest_y,rest_z,deformed_x,deformed_y,deformed_z\n"
    return head + ",".join(["seed", *(str(float(v)) for v in (*MARK[0], *deformed[0]))]) + "\n"


@pytest.fixture
def no_mesher(monkeypatch: pytest.MonkeyPatch) -> None:
    """One cell stands for the mesh, which deformed scans have no part in."""
    points, cell = np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 1, 2, 3]])
    mesh = TetMesh(points, cell, np.array([1]))
    made = MeshedCase(mesh, {"outer": mesh.boundary[0]}, {"cells": 1, "recipe_sha256": ""})
    monkeypatch.setattr(mesh_step, "mesh_labels", lambda *_: made)


def test_a_scan_that_lies_elsewhere_is_found_however_its_organs_are_filled() -> None:
    found = rigid_offset_between(pelvis(), pelvis(2.0).moved(ELSEWHERE))
    assert found is not None
    bone = pelvis().to_lps(np.argwhere(pelvis().array == 4))
    away = found.back(by(ELSEWHERE, bone)) - bone
    assert np.abs(away).max() < 0.3
    assert found.turn_deg == pytest.approx(7.55, abs=0.3)
    assert found.shift_mm == pytest.approx(
        np.linalg.norm(by(ELSEWHERE, np.array([0.0, -5.0, 0.0])) - [0.0, -5.0, 0.0]), abs=0.3
    )


@pytest.mark.parametrize(
    "deformed",
    [
        pytest.param(pelvis(), id="itself"),
        pytest.param(pelvis(2.0), id="filled"),
        pytest.param(pelvis(bones_mm=3.0), id="bones alone moved"),
        pytest.param(pelvis(edge_mm=33.0), id="less drawn"),
        pytest.param(pelvis(edge_mm=33.0).moved(ELSEWHERE), id="elsewhere, but less drawn"),
    ],
)
def test_nothing_else_is_laid_on_its_bones(deformed: Volume) -> None:
    assert rigid_offset_between(pelvis(), deformed) is None


def test_a_region_without_an_edge_and_a_scan_without_bones_tell_nothing() -> None:
    full = pelvis()
    full.array[full.array == 0] = 3
    assert rigid_offset_between(full, full.moved(ELSEWHERE)) is None
    soft = pelvis()
    soft.array[soft.array == 4] = 3
    assert rigid_offset_between(soft, soft.moved(ELSEWHERE)) is None


def test_surfaces_and_points_of_all_states_come_to_lie_in_the_frame_at_rest(tmp_path: Path, no_mesher: None) -> None:
    state = {"name": "another day", "labels": "deformed_2.nii.gz", "landmarks": "landmarks_2.csv"}
    away = by(ELSEWHERE, MARK)
    case = make_case(tmp_path / "case", pelvis(2.0).moved(ELSEWHERE), away)
    case.write_labels("rest", pelvis(3.0).moved(ELSEWHERE))
    case.file("rest.nii.gz").rename(case.file("deformed_2.nii.gz"))
    case.write_labels("rest", pelvis())
    case.write_text("landmarks_2.csv", marked(away))
    case.write_json("case.json", {**json.loads(case.file("case.json").read_text()), "states": [state]})
    case = CaseFolder(case.path)
    mesh_step.run(case)
    problem = problem_of(case)
    want = mesh_step.surface_arrays("deformed", pelvis(2.0))
    np.testing.assert_allclose(
        problem.organ.deformed.points.mean(axis=0), want["deformed_organ_points"].mean(axis=0), atol=0.1
    )
    np.testing.assert_allclose(problem.landmarks[:, 3:], MARK, atol=0.2)
    (further,) = further_states(case)
    np.testing.assert_allclose(middle(state_labels(case, further)), middle(pelvis(3.0)), atol=0.1)
    points = state_landmarks(case, further)
    assert points is not None
    np.testing.assert_allclose(points.deformed, MARK, atol=0.2)
    first, second = diagnose.rigid_offset_notes(case)
    assert first.startswith("the deformed scan lay ") and "palpate import" in first
    assert second.startswith("the scan 'another day' lay ")


def test_a_case_that_was_imported_is_left_as_it_is(tmp_path: Path, no_mesher: None) -> None:
    """`import` has aligned it, or was told not to."""
    case = make_case(tmp_path / "case", pelvis(2.0).moved(ELSEWHERE), by(ELSEWHERE, MARK))
    case.write_json("import.json", {})
    mesh_step.run(case)
    np.testing.assert_allclose(problem_of(case).landmarks[:, 3:], by(ELSEWHERE, MARK), atol=1e-9)
    assert diagnose.rigid_offset_notes(case) == []


def test_a_scan_moved_rigidly_has_no_gap(tmp_path: Path) -> None:
    """The scan at rest, taken once more with the patient lying elsewhere."""
    case = make_case(tmp_path / "case", pelvis().moved(ELSEWHERE), by(ELSEWHERE, MARK))
    mesh_step.run(case, MeshOptions(target_tets=1500))
    found = plain(diagnose.run(case))
    check_form(case.read_json("diagnosis.json"), "diagnosis")
    assert found["verdict"] == "none"
    assert found["gap"]["rms_mm"] < 0.15
    assert any("was laid on its bones first" in flag for flag in found["flags"])
