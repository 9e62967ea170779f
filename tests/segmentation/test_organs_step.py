"""The segment step on a case, and the Dice table."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from organ_scans import found, scan, truth, truth_of
from scipy import ndimage

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.case.labels_on_scan import labels_on_scan
from palpate.case.steps import carried_over, segment_state
from palpate.case.steps.segment import run_segment
from palpate.case.steps.segment_options import SegmentOptions
from palpate.case.surface_errors import StatedErrors
from palpate.core.errors import InputError, PalpateError
from palpate.core.worker.executors import SerialExecutor
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.labels import BLADDER
from palpate.imaging.volume import Volume
from palpate.segmentation.pelvis import Segmentation
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.propagation import CarriedOrgan, carried_organs
from palpate.segmentation.search_region import Found, Scene
from palpate.segmentation.surface_error import SurfaceErrors
from palpate.segmentation.working_grid import mask_on
from palpate.validate.segmentation import dice as dice_module
from palpate.validate.segmentation.dice import dice, dice_table, extremes_of

# The test phantom's scan is smaller than the region that a whole pelvis is modelled in.
NEAR = SegmentOptions(margin_mm=(34.0, 34.0, 30.0))


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CaseFolder:
    """A case whose scans are the phantom's, and whose organs have been found before."""
    made = CaseFolder.create(tmp_path / "case", CaseFacts("phantom"))
    for state in ("rest", "deformed"):
        made.file(f"{state}_ct").mkdir()
        made.file(f"{state}_ct").joinpath("0001.dcm").write_text(state)
    monkeypatch.setattr(CaseFolder, "ct", lambda self, state: scan())
    monkeypatch.setattr(segment_state, "segment_pelvis", _segment_again)
    monkeypatch.setattr(segment_state, "surface_errors", _errors)
    monkeypatch.setattr(carried_over, "carried_organs", _carried_again)
    return made


_CARRIED: dict[str, dict[str, CarriedOrgan] | None] = {}


def _carried_again(
    segmentation: Segmentation,
    drawn: Mapping[str, Volume],
    names: Sequence[str],
    scans: tuple[Volume, Volume],
    progress: Any,
) -> dict[str, CarriedOrgan] | None:
    """As `carried_organs`, which is asked once for the same scans, contours and names."""
    grid = segmentation.scene.grid
    organs = {name: drawn.get(name, grid.with_array(found.mask)) for name, found in segmentation.organs.items()}
    made_from = hashlib.sha256(repr((sorted(organs), sorted(drawn), names)).encode())
    for volume in (*(organs[name] for name in sorted(organs)), *scans):
        made_from.update(volume.array.tobytes())
        made_from.update(volume.affine.tobytes())
    key = made_from.hexdigest()
    if key not in _CARRIED:
        _CARRIED[key] = carried_organs(segmentation, drawn, names, scans, progress)
    return _CARRIED[key]


def dying(folder: str, state: str, drawn: bool) -> None:
    os._exit(1)


def _errors(scene: Scene, prompts: Prompts, organs: dict[str, Found]) -> dict[str, SurfaceErrors]:
    """As of a segmentation that is 1.5 mm off everywhere."""
    low = scene.grid.affine[:3, 3]
    return {
        name: SurfaceErrors(low[None], np.array([1.5]), 0.81)
        for name, found in organs.items()
        if found.method not in ("user", "propagated")
    }


def _segment_again(
    ct: Volume, prompts: Any, drawn: dict[str, Volume], progress: Any, model: Any, whole: Any, carried: Any
) -> Segmentation:
    """What was found before, with drawn organs, or those of the other scan, in place of the found ones."""
    grid = found().scene.grid
    own = {name: organ(grid) for name, organ in carried.items()}
    own |= {name: Found(mask_on(m, grid), "user", 1.0) for name, m in drawn.items()}
    return Segmentation(found().scene, {**found().organs, **own})


def _given_back(case: CaseFolder, into: Path, change: bool = False) -> CaseFolder:
    """A new case of the same scans with the exported labels of another; change : with a bladder that was painted larger."""
    new = CaseFolder.create(into, CaseFacts("phantom"))
    split = {}
    for state in ("rest", "deformed"):
        new.file(f"{state}_ct").mkdir()
        new.file(f"{state}_ct").joinpath("0001.dcm").write_text(state)
        labels = labels_on_scan(case, state)
        if change and state == "rest":
            more = ndimage.binary_dilation(labels.array == BLADDER, iterations=2) & (labels.array == 0)
            labels = labels.with_array(np.where(more, BLADDER, labels.array).astype(np.uint8))
        with new.atomic_path(f"{state}_user.nii.gz") as path:
            write_labels(path, labels)
        split[state] = {"prostate_is_split": True}
    new.write_json("user_labels.json", split)
    return new


def test_labels_that_come_back_unchanged_stay_found_automatically(case: CaseFolder, tmp_path: Path) -> None:
    before = run_segment(case, NEAR)
    new = _given_back(case, tmp_path / "new")
    after = run_segment(new, NEAR)
    assert after["states"] == before["states"] and {
        o["method"] for o in after["states"]["rest"]["organs"].values()
    } == {"auto"}
    for name in ("rest.nii.gz", "deformed.nii.gz", "rest_bones.nii.gz", "surface_errors.npz"):
        assert file_sha256(new.file(name)) == file_sha256(case.file(name)), name
    assert any("nothing was changed" in note for note in after["notes"])


def test_one_painted_organ_changes_one_organ(case: CaseFolder, tmp_path: Path) -> None:
    before = run_segment(case, NEAR)
    new = _given_back(case, tmp_path / "new", change=True)
    after = run_segment(new, NEAR)
    methods = {name: organ["method"] for name, organ in after["states"]["rest"]["organs"].items()}
    assert methods == {"prostate": "auto", "bladder": "user", "rectum": "auto"}
    old, painted = case.labels("rest").array, new.labels("rest").array
    others = (old != BLADDER) & (painted != BLADDER)
    assert np.array_equal(old[others], painted[others])
    assert (painted[old == BLADDER] == BLADDER).all() and (painted == BLADDER).sum() > 1.05 * (old == BLADDER).sum()
    assert set(StatedErrors(new).rms_mm()["rest"]) == {"organ", "rectum"}, "a painted surface has no estimated error"
    assert after["states"]["deformed"] == before["states"]["deformed"]
    assert np.array_equal(new.labels("deformed").array, case.labels("deformed").array)


def test_the_scan_at_rest_alone(case: CaseFolder) -> None:
    case.file("deformed_ct").joinpath("0001.dcm").unlink()
    case.file("deformed_ct").rmdir()
    report = run_segment(case, NEAR)
    assert list(report["states"]) == ["rest"] and not case.has_labels("deformed")
    assert {1, 2} <= set(np.unique(case.labels("rest").array)) and case.has("rest_bones.nii.gz")
    assert run_segment(case, NEAR) == report


def test_a_process_beside_makes_the_same_labels_and_starts_before_the_errors_at_rest(
    case: CaseFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process is stood in for by this one; that it is led to the prostate at rest is in the prompts."""
    alone, order = run_segment(case, NEAR), list[str]()
    labels = {state: case.labels(state).array for state in ("rest", "deformed")}
    case.remove("segmentation.json")
    for state in labels:
        case.remove(f"{state}.nii.gz")
    asked = {}

    def whole_scan(ct: Volume) -> None:
        order.append("whole scan")

    def segmented(ct: Volume, prompts: Prompts, *rest: Any) -> Segmentation:
        order.append("organs")
        asked[len(asked)] = dict(prompts.seeds)
        return _segment_again(ct, prompts, *rest)

    def errors(scene: Scene, prompts: Prompts, organs: dict[str, Found]) -> dict[str, SurfaceErrors]:
        order.append("errors")
        return _errors(scene, prompts, organs)

    monkeypatch.setattr(segment_state, "whole_scan", whole_scan)
    monkeypatch.setattr(segment_state, "segment_pelvis", segmented)
    monkeypatch.setattr(segment_state, "surface_errors", errors)
    monkeypatch.setattr(segment_state, "one_more_process", SerialExecutor)
    assert run_segment(case, NEAR, workers=2) == alone
    for state, array in labels.items():
        np.testing.assert_array_equal(case.labels(state).array, array)
    assert order == ["whole scan", "organs", "organs", "errors", "errors"]
    assert "prostate" not in asked[0] and "prostate" in asked[1], "the first is the scan at rest"


def test_a_process_beside_that_dies_is_one_line(case: CaseFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    """A real process that ends, in place of the reading of the deformed scan."""
    monkeypatch.setattr(segment_state, "_read", dying)
    with pytest.raises(PalpateError, match=r"deformed scan died.*--workers 1"):
        run_segment(case, NEAR, workers=2)


def test_labels_of_both_states(case: CaseFolder) -> None:
    report = run_segment(case, NEAR)
    rest, deformed = case.labels("rest"), case.labels("deformed")
    assert set(np.unique(rest.array)) == set(range(7)) or set(np.unique(rest.array)) == set(range(1, 7))
    assert np.prod(deformed.array.shape) > np.prod(rest.array.shape)
    left, right = (rest.to_lps(np.argwhere(rest.array == v).astype(float))[:, 0].mean() for v in (1, 2))
    assert left > right + 10.0
    assert report["states"]["rest"]["organs"]["prostate"]["method"] == "auto"
    assert report["states"]["rest"]["covers_region"] is True
    volumes = report["states"]["rest"]["volume_in_region_cc"]
    assert volumes["prostate_left"] + volumes["prostate_right"] == pytest.approx(73.9, rel=0.03)
    true = truth_of(1).array
    assert dice(np.isin(_at(rest, truth()), 1), true) > 0.94
    bones = case.bones("rest")
    assert bones is not None
    assert np.array_equal(bones.affine, rest.affine)
    assert np.array_equal(bones.array > 0, rest.array == 4)
    assert report["bone_motion"]["femur_left"]["moved_mm"] < 0.05
    known = report["states"]["rest"]["bones"]
    assert set(known) == {"femur_left", "femur_right", "hip_left", "hip_right", "sacrum"}
    assert known["femur_left"]["volume_cc"] == pytest.approx(known["femur_right"]["volume_cc"], rel=0.1)


def _at(labels: Volume, grid: Volume) -> np.ndarray:
    """Nearest labels of one volume at the voxels of another."""
    points = grid.to_lps(np.indices(grid.array.shape).reshape(3, -1).T.astype(float))
    index = np.rint(labels.to_index(points)).astype(int)
    inside = ((index >= 0) & (index < labels.array.shape)).all(axis=1)
    values = np.zeros(len(points), dtype=np.uint8)
    values[inside] = labels.array[tuple(index[inside].T)]
    return values.reshape(grid.array.shape)


def test_nothing_is_done_twice(case: CaseFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    first = run_segment(case, NEAR)
    monkeypatch.setattr(segment_state, "segment_pelvis", lambda *a, **k: pytest.fail("segmented again"))
    assert run_segment(case, NEAR) == first
    # Another margin is another result.
    with pytest.raises(pytest.fail.Exception, match="segmented again"):
        run_segment(case, SegmentOptions(margin_mm=(30.0, 30.0, 30.0)))


def test_drawn_labels_win_to_the_voxel(case: CaseFolder) -> None:
    drawn = np.zeros(truth().array.shape, dtype=np.uint8)
    drawn[np.roll(truth_of(1, 2).array, 3, axis=1)] = 1
    write_labels(case.file("rest_user.nii.gz"), truth().with_array(drawn))
    case.write_json("user_labels.json", {"rest": {"prostate_is_split": False}})
    report = run_segment(case, replace(NEAR, propagate=False))
    rest = case.labels("rest")
    kept = _at(rest, truth())
    assert np.array_equal(np.isin(kept, (1, 2)), drawn > 0)
    assert (kept == 2).any()
    assert report["states"]["rest"]["organs"]["prostate"] == {
        "method": "user",
        "confidence": 1.0,
        "volume_cc": report["states"]["rest"]["organs"]["prostate"]["volume_cc"],
    }
    automatic = report["states"]["deformed"]["organs"]["prostate"]
    assert automatic["method"] == "auto" and (automatic["confidence"], automatic["error_mm"]) == (0.81, 1.5)
    errors = StatedErrors(case).rms_mm()
    assert set(errors["rest"]) == {"bladder", "rectum"} and errors["deformed"]["organ"] == 1.5


def test_what_was_drawn_in_one_scan_is_carried_over_to_the_other(
    case: CaseFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The deformed scan is the one at rest 3 mm farther back; the drawing is 4.8 mm off what the CT shows, in both alike."""
    behind = np.eye(4)
    behind[1, 3] = 3.0
    monkeypatch.setattr(CaseFolder, "ct", lambda self, state: scan() if state == "rest" else scan().moved(behind))
    drawn = np.roll(truth_of(1, 2).array, 3, axis=1).astype(np.uint8)
    write_labels(case.file("rest_user.nii.gz"), truth().with_array(drawn))
    case.write_json("user_labels.json", {"rest": {"prostate_is_split": False}})
    report = run_segment(case, NEAR)
    at_rest, there = (report["states"][state]["organs"] for state in ("rest", "deformed"))
    assert {found["method"] for found in there.values()} == {"propagated"} and at_rest["rectum"]["method"] == "auto"
    assert there["rectum"]["error_mm"] > at_rest["rectum"]["error_mm"]  # errs as at rest, and by the motion
    assert there["rectum"]["confidence"] < at_rest["rectum"]["confidence"]
    rest, deformed = case.labels("rest"), case.labels("deformed")
    middle = [v.to_lps(np.argwhere(np.isin(v.array, (1, 2))).mean(axis=0)[None])[0] for v in (rest, deformed)]
    np.testing.assert_allclose(middle[1] - middle[0], [0.0, 3.0, 0.0], atol=0.3)
    assert any("carried over from the scan at rest" in note for note in report["notes"])
    errors = StatedErrors(case).rms_mm()
    assert "organ" not in errors["rest"] and 0.1 < errors["deformed"]["organ"] < 1.5
    assert StatedErrors(case).found_automatically("rest", "rectum") and not StatedErrors(case).shows_motion("rectum")


def test_drawn_halves_are_kept(case: CaseFolder) -> None:
    drawn = np.where(truth_of(1, 2).array, 2, 0).astype(np.uint8)
    drawn[truth_of(1).array & (np.arange(drawn.shape[2]) % 2 == 0)] = 1
    write_labels(case.file("rest_user.nii.gz"), truth().with_array(drawn))
    case.write_json("user_labels.json", {"rest": {"prostate_is_split": True}})
    run_segment(case, replace(NEAR, propagate=False))
    assert np.array_equal(_at(case.labels("rest"), truth())[drawn > 0], drawn[drawn > 0])


def test_label_volumes_that_came_with_the_case_stay(case: CaseFolder) -> None:
    for state in ("rest", "deformed"):
        case.write_labels(state, truth())
    before = case.file("rest.nii.gz").read_bytes()
    report = run_segment(case, NEAR)
    assert report["states"]["rest"]["source"] == "label volumes"
    assert case.file("rest.nii.gz").read_bytes() == before


def test_a_case_without_scans_and_labels_is_refused(tmp_path: Path) -> None:
    case = CaseFolder.create(tmp_path / "empty", CaseFacts("empty"))
    with pytest.raises(InputError, match="rest_ct is not there"):
        run_segment(case, NEAR)


def test_dice_table_names_what_it_compares(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def again(ct: Volume, prompts: Prompts) -> Segmentation:
        asked.append(prompts)
        return found()

    monkeypatch.setattr(dice_module, "segment_pelvis", again)
    reference = {"prostate": truth_of(1, 2), "bone": truth_of(4)}
    by = {(row.organ, row.mode): row for row in dice_table(scan(), reference)}
    assert [prompts.mode("prostate") for prompts in asked] == ["auto", "click", "extremes"]
    assert set(by) == {("prostate", mode) for mode in ("auto", "click", "extremes")} | {("bone", "auto")}
    assert by["prostate", "auto"].dice > 0.96
    assert by["bone", "auto"].share_inside > 0.99
    assert by["prostate", "auto"].shift_mm < 1.0
    assert by["prostate", "auto"].to_dict()["reference_cc"] == pytest.approx(73.1, abs=0.5)


def test_dice_table_refuses_what_it_does_not_know() -> None:
    with pytest.raises(InputError, match="'liver' is no organ"):
        dice_table(scan(), {"liver": truth_of(1)})
    with pytest.raises(InputError, match="mode 'guess' is unknown"):
        dice_table(scan(), {"prostate": truth_of(1)}, modes=("guess",))


def test_extreme_points_lie_on_the_outside() -> None:
    mask = truth_of(1, 2)
    points = extremes_of(mask)
    inside = mask.to_lps(np.argwhere(mask.array).astype(float))
    assert points[:, 0].min() == pytest.approx(inside[:, 0].min() - 0.5 * mask.spacing[0])
    assert points[:, 2].max() == pytest.approx(inside[:, 2].max() + 0.5 * mask.spacing[2])
    assert points.shape == (6, 3)


def test_two_empty_masks_agree() -> None:
    nothing = np.zeros((2, 2, 2), dtype=bool)
    assert dice(nothing, nothing) == 1.0
    assert dice(nothing, ~nothing) == 0.0
