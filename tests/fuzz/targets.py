"""Every parser of files that a person may give, and a good file for each: what fuzzing damages."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import nibabel as nib
import numpy as np
import SimpleITK as sitk

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fixtures"))
from case_targets import MAKERS, Made
from dicom_samples import enhanced_ct, save, series, straight, structure_set

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.landmarks import read_landmarks
from palpate.case.steps.simulate.spec import load_spec, parse_spec
from palpate.imaging.contours.dicom_seg import read_dicom_seg
from palpate.imaging.contours.itksnap_labels import label_description, label_values
from palpate.imaging.contours.itksnap_workspace import LABEL_LAYER, MAIN, Layer, workspace_text
from palpate.imaging.contours.named_labels import labels_of
from palpate.imaging.contours.nifti_labels import read_labels, write_labels, write_nifti
from palpate.imaging.contours.rtstruct import read_rtstruct
from palpate.imaging.contours.seg_nrrd import read_seg_nrrd, write_seg_nrrd
from palpate.imaging.contours.user_labels import read_label_volume, read_user_labels
from palpate.imaging.dicom.series import read_series
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.registration.dicom_registration import read_registration
from palpate.imaging.scans.scan import read_scan
from palpate.imaging.scans.volume_file import write_volume_file
from palpate.imaging.volume import Volume
from palpate.segmentation.prompts import parse_prompts


@dataclass(frozen=True)
class Target:
    """path : the good file, to be damaged in place. read : reads it, raising InputError only. is_text : its kind."""

    name: str
    path: Path
    read: Callable[[], object]
    is_text: bool


def all_targets(folder: Path) -> list[Target]:
    """One target for each parser, with files under a new folder."""
    makers = (
        _dicom_slice, _dicom_multi_frame, _rtstruct, _dicom_seg,
        _registration, _scan_mha, _scan_nrrd, _scan_nifti, _nifti, _nifti_gz, _label_mha, _label_nrrd, _seg_nrrd, _workspace, _label_text,
        _landmarks, _case_json, _spec, _npz, _prompts, *MAKERS,
    )  # fmt: skip
    found = []
    for make in makers:
        place = folder / make.__name__.strip("_")
        place.mkdir(parents=True)
        path, read, is_text = make(place)
        found.append(Target(place.name, path, read, is_text))
    return found


def _labels() -> Volume:
    array = np.zeros((8, 9, 7), dtype=np.uint8)
    array[2:4, 3:6, 1:5], array[4:6, 3:6, 1:5], array[1:3, 7:, 2:6] = 1, 2, 5
    return Volume(array, np.diag([1.5, 2.0, 3.0, 1.0]))


def _dicom_slice(folder: Path) -> Made:
    save(folder, series(straight()))
    return folder / "im_002.dcm", lambda: read_series(folder), False


def _dicom_multi_frame(folder: Path) -> Made:
    save(folder, [enhanced_ct(straight())])
    return folder / "im_000.dcm", lambda: read_series(folder), False


def _rtstruct(folder: Path) -> Made:
    ct, facts = read_series(save(folder / "ct", series(straight())))
    ring = [np.array([[0, 0, z], [10, 0, z], [10, 12, z], [0, 14, z]], dtype=float) for z in (8.0, 11.0, 14.0)]
    structure_set({"Prostata": ring, "Retto": ring}).save_as(folder / "rs.dcm")
    return folder / "rs.dcm", lambda: read_rtstruct(folder / "rs.dcm", ct, facts), False


def _dicom_seg(folder: Path) -> Made:
    from palpate.ui.dicom.label_segments import label_segmentation

    case = CaseFolder.create(folder / "case", CaseFacts("fuzz"))
    grid = _labels()
    who = SeriesIdentity("f", "f^f", "s", "r", "f", 1, "study", "CT", "a test")
    write_ct_series(case.file("rest_ct"), grid.with_array(grid.array * 100.0), who, compress=False)
    case.write_labels("rest", grid)
    path = folder / "seg.dcm"
    label_segmentation(case, "rest").save_as(path, enforce_file_format=True)
    return path, lambda: labels_of(read_dicom_seg(path), str(path)), False


def _registration(folder: Path) -> Made:
    from palpate.ui.export.dicom_reg import export

    case = CaseFolder.create(folder / "case", CaseFacts("fuzz"))
    for state in ("rest", "deformed"):
        who = SeriesIdentity("f", "f^f", "s", state, state, 1, "study", "CT", "a test")
        write_ct_series(case.file(f"{state}_ct"), _ct(), who, compress=False)
    turn = np.eye(4)
    turn[:3, 3] = [1.0, 2.0, 3.0]
    case.write_json("alignment.json", {"deformed_to_rest": turn, "residual_mm": 0.1})
    (path,) = export(case, folder)
    facts = [case.series(state)[1] for state in ("rest", "deformed")]
    return path, lambda: read_registration(path, *facts), False


def _ct() -> Volume:
    """A body of fat and muscle in air."""
    array = np.full((8, 9, 7), -1000, dtype=np.int16)
    array[1:7, 1:8], array[2:6, 2:7] = -100, 50
    return Volume(array, np.diag([1.5, 2.0, 3.0, 1.0]))


def _scan_mha(folder: Path) -> Made:
    path = folder / "a.mha"
    sitk.WriteImage(_ct().to_sitk(), str(path), useCompression=True)
    return path, lambda: read_scan(path), False


def _scan_nrrd(folder: Path) -> Made:
    path = folder / "a.nrrd"
    write_volume_file(path, _ct())
    return path, lambda: read_scan(path), False


def _scan_nifti(folder: Path) -> Made:
    path = folder / "a.nii"
    write_nifti(path, _ct())
    return path, lambda: read_scan(path), False


def _nifti(folder: Path) -> Made:
    path = folder / "a.nii"
    write_labels(path, _labels())
    image = nib.Nifti1Image.from_bytes(path.read_bytes())
    names = '<Label Key="1">Prostata sx</Label><Label Key="2">Prostata dx</Label><Label Key="5">Vescica</Label>'
    image.header.extensions.append(nib.nifti1.Nifti1Extension(0, names.encode()))
    nib.save(image, path)
    return path, lambda: read_label_volume(path), False


def _nifti_gz(folder: Path) -> Made:
    write_labels(folder / "a.nii.gz", _labels())
    return folder / "a.nii.gz", lambda: read_labels(folder / "a.nii.gz"), False


def _label_mha(folder: Path) -> Made:
    path = folder / "a.mha"
    sitk.WriteImage(_labels().to_sitk(), str(path))
    return path, lambda: read_label_volume(path), False


def _label_nrrd(folder: Path) -> Made:
    path = folder / "a.nrrd"
    sitk.WriteImage(_labels().to_sitk(), str(path))
    return path, lambda: read_label_volume(path), False


def _seg_nrrd(folder: Path) -> Made:
    path = folder / "a.seg.nrrd"
    write_seg_nrrd(path, _labels())
    return path, lambda: labels_of(read_seg_nrrd(path), str(path)), False


def _workspace(folder: Path) -> Made:
    grid = _labels()
    write_labels(folder / "a.nii.gz", grid)
    layers = [Layer(folder / "ct.nii.gz", MAIN), Layer(folder / "a.nii.gz", LABEL_LAYER)]
    path = folder / "a.itksnap"
    path.write_text(workspace_text(layers, folder, grid.array.shape))
    return path, lambda: read_user_labels(path, grid), True


def _label_text(folder: Path) -> Made:
    path = folder / "labels.txt"
    path.write_text(label_description())
    return path, lambda: label_values(path), True


def _landmarks(folder: Path) -> Made:
    path = folder / "landmarks.csv"
    path.write_text(
        "name,rest_x,rest_y,rest_z,deformed_x,deformed_y,deformed_z\nseed 1,1,2,3,4,5,6\nb,-1,2e1,3,4,5,6\n"
    )
    return path, lambda: read_landmarks(path), True


def _case_json(folder: Path) -> Made:
    case = CaseFolder.create(
        folder / "case", CaseFacts("fuzz", gravity_rest=(0.0, 9.81, 0.0), boundary_noise_sd_mm=0.4)
    )
    return case.file("case.json"), lambda: CaseFolder(case.path), True


def _spec(folder: Path) -> Made:
    path = folder / "spec.json"
    sample = Path(__file__).resolve().parents[2] / "sample_dicom" / "spec.json"
    path.write_text(json.dumps(json.loads(sample.read_text()), indent=1))
    return path, lambda: parse_spec(load_spec(path), folder), True


def _npz(folder: Path) -> Made:
    case = CaseFolder.create(folder / "case", CaseFacts("fuzz"))
    case.write_npz("mesh.npz", points=np.eye(3), cells=np.arange(8).reshape(2, 4))
    return case.file("mesh.npz"), lambda: case.read_npz("mesh.npz"), False


def _prompts(folder: Path) -> Made:
    path = folder / "prompts.txt"
    six = ";".join(["-9,0,0", "9,0,0", "0,-8,0", "0,8,0", "0,0,-7", "0,0,7"])
    path.write_text(f"prostate=-6.5,11,-148\nbladder={six}\nrectum=-9,-9,-9;9,9,9")

    def read() -> object:
        lines = path.read_bytes().decode("utf-8", "replace").split("\n")
        return parse_prompts(lines[:1], lines[1:2], lines[2:])

    return path, read, True
