"""A pair of closed surfaces becomes a case: what is mended, what is refused, and what such a pair can and cannot tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from schemas import check_form
from scipy.spatial.transform import Rotation

from palpate.case.case_folder import CaseFolder
from palpate.case.steps import identify
from palpate.case.steps.import_scans.options import ImportOptions, inputs_sha256
from palpate.case.steps.import_scans.surfaces import SurfaceImportOptions, run_surface_import
from palpate.core.errors import InputError
from palpate.core.files.json_types import plain
from palpate.core.identify.pair.surface_alignment import aligned
from palpate.core.problem import SurfacePair
from palpate.core.surfaces.surface import Surface
from palpate.imaging.surfaces.surface_files import read_closed_surface
from palpate.meshing import mesh_labels

REAL = Path(__file__).parents[3] / "shared" / "data" / "prostate_mr_us"
AXES = np.array([19.0, 15.0, 12.0])
# A pear: no turn but none takes it onto itself.
TAPER = np.array([[0.25, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.0]])


def pear(turns: int = 24) -> pv.PolyData:
    ball = pv.Sphere(radius=1.0, theta_resolution=turns, phi_resolution=turns)
    x = np.asarray(ball.points, dtype=np.float64)
    x = x * AXES * (1.0 + (x @ TAPER.sum(axis=1))[:, None] * [0.0, 1.0, 0.5])
    return pv.PolyData.from_regular_faces(x, ball.regular_faces)


def saved(mesh: pv.PolyData, path: Path) -> Path:
    mesh.save(path)
    return path


def squeezed(x: np.ndarray) -> np.ndarray:
    """No change of volume: shorter along y by a tenth, longer along x."""
    return np.asarray(x * [1.0 / 0.9, 0.9, 1.0])


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj"])
def test_every_form_is_read_closed_and_outward(tmp_path: Path, suffix: str) -> None:
    found = read_closed_surface(saved(pear(), tmp_path / f"a{suffix}")).surface
    assert found.enclosed_volume == pytest.approx(pear().volume, rel=1e-4)


def test_what_can_be_mended_is_and_that_is_said(tmp_path: Path) -> None:
    mesh = pear()
    faces = mesh.regular_faces
    apart = pv.PolyData.from_regular_faces(mesh.points[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3))
    assert apart.n_open_edges == 3 * len(faces)
    found = read_closed_surface(saved(apart, tmp_path / "apart.ply"))
    assert found.surface.enclosed_volume == pytest.approx(mesh.volume, rel=1e-4)
    assert found.notes == (f"{3 * len(faces) - mesh.n_points} points that coincide with others were joined",)

    inside_out = pv.PolyData.from_regular_faces(mesh.points, faces[:, ::-1])
    found = read_closed_surface(saved(inside_out, tmp_path / "in.ply"))
    assert found.surface.enclosed_volume > 0.0
    assert found.notes == (f"{len(faces)} faces that looked inwards were turned",)

    half = faces.copy()
    half[::2] = half[::2, ::-1]
    assert read_closed_surface(saved(pv.PolyData.from_regular_faces(mesh.points, half), tmp_path / "h.ply")).notes

    fine = pear(60)
    pricked = pv.PolyData.from_regular_faces(fine.points, np.delete(fine.regular_faces, 700, axis=0))
    found = read_closed_surface(saved(pricked, tmp_path / "pricked.ply"))
    assert found.surface.enclosed_volume == pytest.approx(fine.volume, rel=1e-3)
    assert "1 holes of up to" in found.notes[0]


def holed() -> pv.PolyData:
    mesh = pear()
    return pv.PolyData.from_regular_faces(mesh.points, mesh.regular_faces[mesh.cell_centers().points[:, 0] < 14.0])


def two_bodies() -> pv.PolyData:
    other = pear()
    other.points += [60.0, 0.0, 0.0]
    return pear().merge(other, merge_points=False)


def crossing() -> pv.PolyData:
    """An end pulled through the middle and out at the other side."""
    mesh = pear(40)
    mesh.points[:, 0] = np.where(mesh.points[:, 0] > 12.0, 12.0 - 8.0 * (mesh.points[:, 0] - 12.0), mesh.points[:, 0])
    return mesh


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (holed(), r"a\.ply has a hole 2\d.* mm wide"),
        (two_bodies(), r"a\.ply holds 2 separate surfaces"),
        (pv.PolyData(np.zeros((0, 3))), r"a\.ply .*(holds no surface|not readable)"),
        (pear().scale(1e-3), r"a\.ply is 0\.0379 mm across.*metres"),
        (crossing(), r"a\.ply crosses itself in \d+ faces"),
        (pv.Plane(i_size=30.0, j_size=30.0), r"a\.ply has a hole 30 mm wide"),
    ],
    ids=["holed", "two", "empty", "metres", "crossing", "open sheet"],
)
def test_what_cannot_be_mended_is_refused_in_one_line(tmp_path: Path, mesh: pv.PolyData, words: str) -> None:
    with pytest.raises(InputError, match=words) as refused:
        read_closed_surface(saved(mesh, tmp_path / "a.ply"))
    assert "\n" not in str(refused.value)


def test_what_is_no_surface_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(b"solid nonsense\x00\xff" * 20)
    with pytest.raises(InputError, match=r"a\.stl"):
        read_closed_surface(tmp_path / "a.stl")
    with pytest.raises(InputError, match="no STL, OBJ or PLY"):
        read_closed_surface(saved(pear(), tmp_path / "a.ply").rename(tmp_path / "a.txt"))


@pytest.mark.parametrize("turn", [[0.1, -0.2, 0.15], [2.5, 1.0, -0.5]], ids=["near", "another frame"])
def test_frames_are_brought_together(turn: list[float]) -> None:
    mesh = pear(30)
    faces = np.asarray(mesh.regular_faces, dtype=np.int64)
    rotation = Rotation.from_rotvec(turn)
    moved = rotation.apply(mesh.points) + [40.0, -7.0, 11.0]
    pair = SurfacePair(*(Surface(x, faces, np.ones(len(faces), dtype=np.int64)) for x in (mesh.points, moved)))
    matrix = aligned(pair)
    assert np.abs(matrix[:3, :3] @ rotation.as_matrix() - np.eye(3)).max() < 0.02


def test_a_folder_that_is_given_as_a_file_is_called_one(tmp_path: Path) -> None:
    (folder := tmp_path / "b.stl").mkdir()
    rest = saved(pear(), tmp_path / "a.ply")
    with pytest.raises(InputError, match=r"b\.stl is a folder; give the file$"):
        run_surface_import(rest, folder, tmp_path / "case")
    with pytest.raises(InputError, match=r"b\.stl is a folder; give the file of the labels, landmarks or registration"):
        inputs_sha256({}, ImportOptions(labels=(folder, None)))


def test_volumes_that_differ_too_much_are_refused_and_nothing_is_written(tmp_path: Path) -> None:
    paths = saved(pear(), tmp_path / "a.ply"), saved(pear().scale(1.4), tmp_path / "b.ply")
    with pytest.raises(InputError, match=r"a factor of 2\.74"):
        run_surface_import(*paths, tmp_path / "case")
    assert not (tmp_path / "case").exists()


def test_a_pair_becomes_a_case_that_says_what_it_cannot_tell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_labels, "MESH_ATTEMPTS", 1)  # any mesh will do here
    marks = np.array([[4.0, 3.0, 2.0], [-6.0, 2.0, -3.0], [1.0, -6.0, 1.0]])
    mesh = pear(40)
    moved = pv.PolyData.from_regular_faces(squeezed(mesh.points), mesh.regular_faces)
    lines = [
        f"m{k},{','.join(map(str, (*a, *b)))}" for k, (a, b) in enumerate(zip(marks, squeezed(marks), strict=True))
    ]
    csv = tmp_path / "marks.csv"
    csv.write_text("name,rest_x,rest_y,rest_z,deformed_x,deformed_y,deformed_z\n" + "\n".join(lines))
    paths = saved(mesh, tmp_path / "rest.ply"), saved(moved, tmp_path / "deformed.stl")
    options = SurfaceImportOptions(landmarks=csv, cells=800)
    summary = run_surface_import(*paths, tmp_path / "case", options)
    found = summary["landmarks"]
    assert found["model"]["rms_mm"] < 0.2 < 0.4 < found["rigid"]["rms_mm"]
    assert summary["surface_rms_mm"]["model"] < 0.2
    assert "no pressure is known" in summary["cannot_tell"]
    assert run_surface_import(*paths, tmp_path / "case", options) == summary

    case = CaseFolder(tmp_path / "case")
    result = plain(identify.run(case))
    check_form(case.read_json("result.json"), "result")
    assert result["identifiability"]["verdict"].startswith("nothing can be identified: the organ's surface is all")
    assert result["landmarks"] == found
    with pytest.raises(InputError, match="other scans or surfaces"):
        run_surface_import(paths[1], paths[0], tmp_path / "case", options)


@pytest.mark.shared_data
def test_real_surfaces_are_mended(request: pytest.FixtureRequest) -> None:
    if not REAL.is_dir():
        pytest.skip(f"{REAL} is not there: no real pair of surfaces")
    found = {name: read_closed_surface(REAL / f"{name}_model.ply") for name in ("MR", "US")}
    assert found["MR"].notes == ("8 points that coincide with others were joined",)
    assert found["US"].notes == ("9913 points that coincide with others were joined",)
    volumes = [found[name].surface.enclosed_volume / 1000.0 for name in ("MR", "US")]
    assert volumes == pytest.approx([19.3, 17.8], abs=0.05)
