"""Identifying again from contours drawn anew: the scene's reduced model answers, and refuses where it is another scene."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import synthetic_case
from schemas import check_form

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.steps import reidentify
from palpate.core.errors import InputError
from palpate.core.files.json_types import plain
from palpate.core.identify.job import run
from palpate.core.problem import IdentificationProblem
from palpate.core.surfaces.distance_field import signed_distance
from palpate.core.surfaces.surface import Surface
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.volume import Volume
from palpate.ui.cli import main as cli

# The deformed scan's own frame: contours are drawn there, the case lies in that of the scan at rest.
SHIFT = np.array([4.0, -7.0, 11.0])


@pytest.fixture(scope="module")
def problem() -> IdentificationProblem:
    # A seed that both scans show: the model's answer holds its motion too.
    made = synthetic_case.problem((30.0, 70.0), fine=4)
    return replace(made, facts=replace(made.facts, noise_sd_mm=0.1), landmarks=np.array([[3.0, 0, 0, 3.0, -2.5, 0]]))


@pytest.fixture(scope="module")
def identified(problem: IdentificationProblem, tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    case = CaseFolder.create(tmp_path_factory.mktemp("again") / "case", CaseFacts("made-up"))
    case.write_npz("identify/problem.npz", **problem.arrays())
    case.write_npz("mesh.npz", points=problem.mesh.points)
    to_rest = np.eye(4)
    to_rest[:3, 3] = -SHIFT
    case.write_json("alignment.json", {"deformed_to_rest": to_rest})
    folder = case.file("identify")
    options = {"element": "p1p1", "iterations": 4, "starts": 1, "stiffness_map": False}
    job = Job("palpate.core.identify.job:run", str(folder), {"problem": str(folder / "problem.npz")}, options, seed=1)
    result = plain(run(job, Reporter(lambda message: None)))
    hashes = {name: case.inputs_sha256([name]) for name in ("mesh.npz", "case.json")}
    case.write_json("result.json", {**result, "inputs_sha256": hashes})
    return case


def drawn(organ: Surface, path: Path) -> Path:
    """Labels of what a surface encloses, on voxels of 0.8 mm in the deformed scan's frame."""
    axis = np.arange(-18.0, 14.0, 0.8)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    inside = signed_distance(TriangleTree.of(organ.points, organ.faces), points.reshape(-1, 3)) < 0.0
    array = np.where(inside.reshape(points.shape[:3]), np.where(points[..., 0] > 0.0, 1, 2), 3).astype(np.uint8)
    affine = np.diag([0.8, 0.8, 0.8, 1.0])
    affine[:3, 3] = points[0, 0, 0] + SHIFT
    write_labels(path, Volume(array, affine))
    return path


def test_softer_contours_give_a_softer_half(
    problem: IdentificationProblem, identified: CaseFolder, tmp_path: Path
) -> None:
    first = identified.file("result.json").read_bytes()
    same = plain(reidentify.run(identified, drawn(problem.organ.deformed, tmp_path / "same.nii.gz")))
    organ = synthetic_case.problem((18.0, 70.0), fine=4).organ.deformed
    softer = plain(reidentify.run(identified, drawn(organ, tmp_path / "softer.nii.gz")))
    assert (
        same["parameters"]["prostate_left"]["ci95_kpa"][0] < 30.0 < same["parameters"]["prostate_left"]["ci95_kpa"][1]
    )
    assert softer["parameters"]["prostate_left"]["G_kpa"] < 0.8 * same["parameters"]["prostate_left"]["G_kpa"]
    for result in (same, softer):
        assert result["model_error_mm"] < 0.02
        # The walls are where the first identification took them to be: half-way between sliding freely, as they did, and not.
    assert result["misfit"]["rms_mm"] < 0.2 < result["misfit"]["rms_before_mm"]
    check_form(identified.read_json("again.json"), "again")
    assert identified.read_json("again.json")["parameters"]["prostate_left"] == softer["parameters"][
        "prostate_left"
    ] | {"ci95_kpa": list(softer["parameters"]["prostate_left"]["ci95_kpa"])}
    assert identified.file("result.json").read_bytes() == first


def test_the_command_says_what_was_found(
    problem: IdentificationProblem, identified: CaseFolder, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = drawn(problem.organ.deformed, tmp_path / "Mueller.nii.gz")
    assert cli.main(["identify", str(identified.path), "--again", str(path)]) == 0
    told = capfd.readouterr().out
    assert "found   prostate_left: G = " in told and told.rstrip().endswith("again.json")
    # A file's name may be a patient's.
    assert b"Mueller" not in b"".join(p.read_bytes() for p in identified.path.glob("*.json"))


def test_another_scene_and_labels_without_an_organ_are_refused(
    problem: IdentificationProblem, identified: CaseFolder, tmp_path: Path
) -> None:
    labels = drawn(problem.organ.deformed, tmp_path / "labels.nii.gz")
    other = CaseFolder(shutil.copytree(identified.path, tmp_path / "case"))
    other.save_facts(replace(other.facts, tissue_shear_modulus_kpa=25.0))
    with pytest.raises(InputError, match=r"case\.json is not that of the last identification; run `palpate identify`"):
        reidentify.run(other, labels)
    other.remove("identify/again.npz")
    with pytest.raises(InputError, match="holds no reduced model of this scene"):
        reidentify.run(other, labels)
    other.write_npz("identify/problem.npz", **replace(problem, organ_drawn=False).arrays())
    other.save_facts(identified.facts)
    shutil.copy(identified.file("identify/again.npz"), other.file("identify/again.npz"))
    with pytest.raises(InputError, match="its contour was no datum"):
        reidentify.run(other, labels)
    write_labels(tmp_path / "empty.nii.gz", Volume(np.full((4, 4, 4), 3, np.uint8), np.eye(4)))
    with pytest.raises(InputError, match="holds no prostate"):
        reidentify.run(identified, tmp_path / "empty.nii.gz")
    with pytest.raises(InputError, match="is not there; give the labels drawn on the deformed scan"):
        reidentify.run(identified, tmp_path / "none.nii.gz")


def test_contours_that_mislead_tell_no_stiffness_of_new_ones_either(
    problem: IdentificationProblem, identified: CaseFolder, tmp_path: Path
) -> None:
    """The weights are those of the first contours, so that better ones need another identification."""
    case = CaseFolder(shutil.copytree(identified.path, tmp_path / "case"))
    with np.load(case.file("identify/again.npz")) as kept:
        arrays = dict(kept)
    assert str(arrays["untold"]) == ""
    case.write_npz("identify/again.npz", **arrays | {"untold": np.array("contours are all that is seen")})
    with pytest.raises(InputError, match="contours are all that is seen; run `palpate identify` with them"):
        reidentify.run(case, drawn(problem.organ.deformed, tmp_path / "labels.nii.gz"))
    del arrays["untold"]
    case.write_npz("identify/again.npz", **arrays)
    with pytest.raises(InputError, match="holds no reduced model of this scene"):  # of an earlier version
        reidentify.run(case, drawn(problem.organ.deformed, tmp_path / "labels.nii.gz"))
