"""Damaged files of every kind are read, or refused in one line: a short run. `python tests/fuzz/run.py` makes long ones."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest
from damage import check, damaged
from hypothesis import HealthCheck, given, seed, settings
from targets import Target, all_targets

CORPUS = Path(__file__).parent / "corpus"
EXAMPLES = 60
# A folder is read by its files; what its index says is not looked at.
SELDOM_REFUSED = ("dicomdir",)


@pytest.fixture(scope="module")
def targets(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Target]:
    return {target.name: target for target in all_targets(tmp_path_factory.mktemp("fuzz"))}


NAMES = (
    "dicom_slice", "dicom_multi_frame", "rtstruct", "dicom_seg",
    "registration", "scan_mha", "scan_nrrd", "scan_nifti", "nifti", "nifti_gz",
    "label_mha", "label_nrrd", "seg_nrrd", "workspace", "label_text",
    "landmarks", "case_json", "spec", "npz", "prompts",
    "dicom_jpeg2000", "dicom_rle", "dicomdir", "body_json", "cohort_table", "mesh_file", "job_file", "checkpoint", "monai_bundle",
    "surface_stl", "surface_obj", "surface_ply",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_damage_is_read_or_refused(name: str, targets: dict[str, Target]) -> None:
    target = targets[name]
    good = target.path.read_bytes()
    refused = 0

    @seed(7)
    @settings(max_examples=EXAMPLES, deadline=timedelta(seconds=5), database=None,
              suppress_health_check=list(HealthCheck))  # fmt: skip
    @given(damaged(good, target.is_text))
    def run(data: bytes) -> None:
        nonlocal refused
        refused += check(target, data)

    run()
    target.path.write_bytes(good)
    assert not check(target, good)
    assert refused > 0.1 * EXAMPLES or name in SELDOM_REFUSED


def test_every_parser_is_among_them(targets: dict[str, Target]) -> None:
    assert set(targets) == set(NAMES)


@pytest.mark.parametrize("path", sorted(CORPUS.glob("*/*")), ids=lambda p: f"{p.parent.name}/{p.name}")
def test_what_once_broke_a_parser(path: Path, targets: dict[str, Target]) -> None:
    target = targets[path.parent.name]
    good = target.path.read_bytes()
    check(target, path.read_bytes())
    target.path.write_bytes(good)
