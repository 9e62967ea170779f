"""More parsers and a good file for each: compressed DICOM and its index, bodies on a bench, tables, meshes, jobs."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyvista as pv
from pydicom.fileset import FileSet
from pydicom.uid import RLELossless

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fixtures"))
from dicom_samples import save, series, straight

from palpate.case.bench.body import MESH, body_problem
from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.case.stated_files import body_inputs
from palpate.core.errors import InputError
from palpate.core.fem.meshes import box
from palpate.core.mesh import TetMesh
from palpate.core.worker.checkpoint import load_checkpoint, save_checkpoint
from palpate.core.worker.job import Job
from palpate.imaging.dicom.series import read_series
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.surfaces.surface_files import read_closed_surface
from palpate.imaging.volume import Volume
from palpate.meshing.mesh_file import load_mesh, save_mesh
from palpate.meshing.mesh_solid import CELLS
from palpate.segmentation.models.monai_bundle import bundle_plan
from palpate.validate.paper.cohort import cohort_of_table

# The good file, what reads it and raises InputError only, and whether it is text.
Made = tuple[Path, Callable[[], object], bool]


def dicom_jpeg2000(folder: Path) -> Made:
    """The codec halves a picture five times: 32 x 32 is the smallest."""
    grid = Volume(
        np.random.default_rng(3).integers(-60, 300, (32, 36, 4)).astype(np.int16), np.diag([2.0, 1.5, 3.0, 1.0])
    )
    files = write_ct_series(folder, grid, SeriesIdentity("f", "f^f", "s", "r", "f", 1, "study", "CT", "a test"))
    return files[2], lambda: read_series(folder), False


def dicom_rle(folder: Path) -> Made:
    slices = series(straight())
    for each in slices:
        each.compress(RLELossless, generate_instance_uid=False)
    save(folder, slices)
    return folder / "im_002.dcm", lambda: read_series(folder), False


def dicomdir(folder: Path) -> Made:
    index = FileSet()
    for each in series(straight()):
        each.StudyID, each.SeriesNumber = "1", 1
        each.StudyTime = "120000"
        index.add(each)
    index.write(folder / "disc")
    return folder / "disc" / "DICOMDIR", lambda: read_series(folder / "disc"), False


def body_json(folder: Path) -> Made:
    """A block that is held at one end; its mesh is there already, since what is damaged is what case.json says."""
    block = box(np.array([10.0, 8.0, 6.0]), (1, 1, 1))
    case = CaseFolder.create(folder / "case", CaseFacts("fuzz"))
    (case.path / "hanging.csv").write_text(
        "name,rest_x,rest_y,rest_z,deformed_x,deformed_y,deformed_z\na,9,4,3,9,4,2\nb,9,1,1,9,1,0\n"
    )
    surface = case.path / "body.stl"
    surface.write_bytes(b"read by nobody: the mesh is there")
    made_from = np.frombuffer(f"{file_sha256(surface)} {CELLS}".encode(), dtype=np.uint8)
    case.write_npz(MESH, points=block.points, cells=block.cells, made_from=made_from)
    facts = json.loads(case.file("case.json").read_text()) | {
        "body": "body.stl",
        "density_kg_m3": 1070.0,
        "supports": [{"name": "clamp", "plane_point": [0.0, 0.0, 0.0], "plane_normal": [1.0, 0.0, 0.0]}],
        "states": [
            {"name": "hanging", "points": "hanging.csv", "gravity": [0.0, 0.0, -9.81],
             "loads": [{"name": "weight", "at": [9.0, 4.0, 6.0], "force_n": [0.0, 0.0, -0.5]}]}
        ],
    }  # fmt: skip
    case.file("case.json").write_text(json.dumps(facts, indent=1))

    def read() -> object:
        again = CaseFolder(case.path)
        return body_problem(again) if "body" in again.facts.other and body_inputs(again) else again

    return case.file("case.json"), read, True


def cohort_table(folder: Path) -> Made:
    path = folder / "cohort.csv"
    path.write_text("stage,mu_kpa\nT1,12.5\nT2,31\nT3,44.0\n4,60\n")
    return path, lambda: cohort_of_table(path), True


def mesh_file(folder: Path) -> Made:
    block = box(np.array([10.0, 8.0, 6.0]), (1, 1, 1))
    path = folder / "mesh.npz"
    save_mesh(path, TetMesh(block.points, block.cells, np.ones(len(block.cells))), {"bone": block.cells[:, :3]}, {})
    return path, lambda: load_mesh(path), False


def job_file(folder: Path) -> Made:
    path = folder / "job.json"
    Job("palpate.core.identify.job:run", str(folder), {"data": "a.npz"}, {"workers": 2}, 1).save(path)
    return path, lambda: Job.load(path), True


def checkpoint(folder: Path) -> Made:
    """A checkpoint that cannot be read is none, and identification begins anew: counted as refused."""
    path = folder / "checkpoint.npz"
    save_checkpoint(path, {"swarm": np.arange(12.0).reshape(3, 4)}, "f")

    def read() -> object:
        found = load_checkpoint(path, "f")
        if found is None:
            raise InputError(f"{path} is no checkpoint of this job")
        return found

    return path, read, False


def monai_bundle(folder: Path) -> Made:
    configs = folder / "configs"
    configs.mkdir()
    channels = {"0": "background", "1": "prostate", "2": "bladder"}
    metadata = {"network_data_format": {"outputs": {"pred": {"channel_def": channels}}}}
    (configs / "metadata.json").write_text(json.dumps(metadata))
    steps = [
        {"_target_": "Orientationd", "axcodes": "RAS"},
        {"_target_": "Spacingd", "pixdim": "@spacing"},
        {"_target_": "ScaleIntensityRanged", "a_min": -100, "a_max": 300, "b_min": 0.0, "b_max": 1.0, "clip": True},
    ]
    inferer = {"_target_": "SlidingWindowInferer", "roi_size": [64, 64, 64], "overlap": 0.5}
    (configs / "inference.json").write_text(
        json.dumps({"spacing": [1.5, 1.5, 2.0], "preprocessing": {"transforms": steps}, "inferer": inferer})
    )
    return configs / "inference.json", lambda: bundle_plan(folder), True


def surface_stl(folder: Path) -> Made:
    return _surface(folder / "organ.stl")


def surface_obj(folder: Path) -> Made:
    return _surface(folder / "organ.obj")


def surface_ply(folder: Path) -> Made:
    return _surface(folder / "organ.ply")


def _surface(path: Path) -> Made:
    """Few faces, binary where the form has it: most bytes are then header or points."""
    ball = pv.Icosphere(radius=20.0, nsub=1)
    ball.save(path, binary=True) if path.suffix != ".obj" else ball.save(path)
    return path, lambda: read_closed_surface(path), path.suffix == ".obj"


MAKERS: tuple[Callable[[Path], Made], ...] = (
    dicom_jpeg2000, dicom_rle, dicomdir, body_json, cohort_table, mesh_file, job_file, checkpoint, monai_bundle,
    surface_stl, surface_obj, surface_ply,
)  # fmt: skip
