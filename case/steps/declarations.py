"""Declarations of the steps, in the order in which a case goes through them. That of the report is
`ui.report.declaration`.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from palpate.case.case_folder import CaseFolder
from palpate.case.diagnosed import stands_otherwise
from palpate.case.matched import FILE as MATCHED
from palpate.case.stated_files import ERRORS_FILE, body_inputs, further_files, is_body
from palpate.case.steps.step import Step

_STEPS = "palpate.case.steps"
_LABELS = ("rest.nii.gz", "deformed.nii.gz")
_SCENE = ("mesh.npz", "surfaces.npz", "case.json", "landmarks.csv")
_MORE = "`noise.json`, `surface_errors.npz`; labels and landmarks of further deformed states"


class _MadeFrom(msgspec.Struct):
    """Hashes of inputs in result.json; absent in results made by hand."""

    inputs_sha256: dict[str, str] = {}


def _with_further_files(case: CaseFolder, reads: tuple[str, ...]) -> tuple[str, ...]:
    return (*reads, *further_files(case))


def _scene_or_body(case: CaseFolder, reads: tuple[str, ...]) -> tuple[str, ...]:
    if is_body(case):
        return body_inputs(case)
    matched = (MATCHED,) if case.has(MATCHED) else ()
    return (*_with_further_files(case, reads), *matched)


def _hashes_of_the_result(case: CaseFolder) -> Mapping[str, str] | None:
    """Hashes in result.json without those of the labels, which act through mesh and surfaces only."""
    hashes = case.read("result.json", _MadeFrom).inputs_sha256 if case.has("result.json") else {}
    return {name: sha for name, sha in hashes.items() if name not in _LABELS} or None


SIMULATE = Step(
    "simulate",
    "make a pair of scans whose stiffness is known",
    (),
    ("case.json", "rest_ct", "deformed_ct", "contours", *_LABELS),
    f"{_STEPS}.simulate.spec:SimulationSpec",
    f"{_STEPS}.simulate.step:run_simulate",
    "a specification outside the case",
)
IMPORT = Step(
    "import",
    "two scans to a case, aligned on bone",
    (),
    (
        *("case.json", "import.json", "rest_ct", "deformed_ct", "alignment.json", "rest_user.nii.gz"),
        *("deformed_user.nii.gz", "user_labels.json", "landmarks.csv", *_LABELS, "surfaces.json"),
    ),
    f"{_STEPS}.import_scans.options:ImportOptions",
    f"{_STEPS}.import_scans.pair:run_import",
    "scans, contours and landmarks outside the case",
)
SEGMENT = Step(
    "segment",
    "scans and contours to label volumes",
    ("rest_ct", "deformed_ct", "alignment.json", "rest_user.nii.gz", "deformed_user.nii.gz", "user_labels.json"),
    (
        *("rest.nii.gz", "deformed.nii.gz", "labels.txt", "segmentation.json"),
        *("rest_bones.nii.gz", "deformed_bones.nii.gz", "bones.txt", ERRORS_FILE),
    ),
    f"{_STEPS}.segment_options:SegmentOptions",
    f"{_STEPS}.segment:run_segment",
)
MESH = Step(
    "mesh",
    "label volumes to one mesh and the surfaces of both states",
    (*_LABELS, "labels.txt"),
    ("mesh.json", "mesh.npz", "surfaces.npz", "mesh.vtu"),
    "palpate.meshing.mesh_labels:MeshOptions",
    f"{_STEPS}.mesh:run",
)
MATCH = Step(
    "match",
    "motion of the tissue between the two scans, from their images",
    ("rest_ct", "deformed_ct", "alignment.json", *_LABELS, "labels.txt", *_SCENE[:3]),
    (MATCHED,),
    "palpate.imaging.matching.local_matching:MatchOptions",
    f"{_STEPS}.match:run",
)
IDENTIFY = Step(
    "identify",
    "mesh and surfaces to stiffness and its uncertainty",
    _SCENE,
    ("result.json", "identify/fields.npz"),
    "palpate.core.identify.options:IdentifyOptions",
    f"{_STEPS}.identify:run",
    _MORE,
    has_job=True,
    inputs_of=_with_further_files,
    record=_hashes_of_the_result,
)
DIAGNOSE = Step(
    "diagnose",
    "where the model is wrong, and which effect it leaves out",
    _SCENE,
    ("diagnosis.json", "diagnose/gap_maps.npz"),
    f"{_STEPS}.diagnose:DiagnoseOptions",
    f"{_STEPS}.diagnose:run",
    f"{_MORE}; `{MATCHED}`; of a body on a bench its surface and points files instead",
    has_job=True,
    inputs_of=_scene_or_body,
    unlike=stands_otherwise,
)
PLAN = Step(
    "plan",
    "what a second scan would tell, from the scan at rest alone",
    ("rest.nii.gz", "labels.txt", "case.json", "noise.json", ERRORS_FILE, "result.json"),
    ("plan.json",),
    f"{_STEPS}.plan:PlanOptions",
    f"{_STEPS}.plan:run",
)
STEPS = (SIMULATE, IMPORT, SEGMENT, MESH, MATCH, IDENTIFY, DIAGNOSE, PLAN)
