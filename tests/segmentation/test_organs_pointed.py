"""Random walks, what six points say of a shape, learned models, and the table of agreement."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import nibabel
import numpy as np
import pytest
from organ_scans import found, scan, truth_of

from palpate.core.errors import InputError
from palpate.imaging.labels import BLADDER
from palpate.imaging.volume import Volume
from palpate.segmentation import organs as organs_module
from palpate.segmentation import pelvis
from palpate.segmentation.methods.extreme_points import ellipsoid_of
from palpate.segmentation.methods.random_walker import walk
from palpate.segmentation.methods.star_surface import sphere
from palpate.segmentation.models.learned import learned_masks
from palpate.segmentation.surface_error import SurfaceErrors
from palpate.validate.segmentation import dice as dice_module
from palpate.validate.segmentation.contoured_scan import ContouredScan, contoured_scan
from palpate.validate.segmentation.study import rank_correlation, segmentation_study, study_text

SHEAR = np.array([[400.0, 90.0, -60.0], [90.0, 225.0, 50.0], [-60.0, 50.0, 300.0]])
CENTRE = np.array([5.0, -30.0, 12.0])


def _points_of(matrix: np.ndarray) -> np.ndarray:
    """Outermost points (6, 3) of an ellipsoid."""
    out = (matrix / np.sqrt(np.diag(matrix))).T
    return np.concatenate([CENTRE + out, CENTRE - out])


def test_a_walk_in_an_even_picture_is_a_straight_line() -> None:
    shape = (11, 2, 3)
    inside, outside = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    inside[0], outside[-1] = True, True
    p = walk(np.zeros(shape), inside, outside, 1.0, np.zeros(shape), 0.0)
    assert p[:, 1, 2] == pytest.approx(np.linspace(1.0, 0.0, 11), abs=0.01)


def test_a_walk_stops_at_an_edge_and_noise_does_not_stop_it() -> None:
    shape = (30, 6, 6)
    values = np.random.default_rng(2).normal(0.0, 3.0, shape)
    values[20:] += 40.0
    inside, outside = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    inside[:2], outside[-2:] = True, True
    p = walk(values, inside, outside, 8.0, np.full(shape, 0.5), 1e-4)
    assert p[:20].min() > 0.8
    assert p[20:].max() < 0.2


def test_a_prior_rules_where_the_picture_is_silent() -> None:
    shape = (8, 8, 8)
    nothing = np.zeros(shape, dtype=bool)
    prior = np.where(np.arange(8) < 3, 0.9, 0.1)[:, None, None] * np.ones(shape)
    p = walk(np.zeros(shape), nothing, nothing, 1.0, prior, 1e3)
    assert p == pytest.approx(prior, abs=0.01)


def test_six_points_give_back_their_ellipsoid(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("palpate.segmentation.methods.extreme_points.TILT_TRUST", 1.0)
    order = np.random.default_rng(4).permutation(6)
    found_one = ellipsoid_of(_points_of(SHEAR)[order])
    assert found_one.centre == pytest.approx(CENTRE)
    assert found_one.matrix == pytest.approx(SHEAR)


def test_widest_points_above_the_middle_make_a_shape_that_narrows_downwards() -> None:
    semi = np.array([22.0, 18.0, 20.0])
    high = 0.5 * semi[2]
    points = CENTRE + [[22, 0, high], [-22, 0, high], [0, 18, high], [0, -18, high], [0, 0, 20], [0, 0, -20]]
    made = ellipsoid_of(points)
    assert made.taper == pytest.approx(0.35)
    upper, lower = (made.level_of(np.array([16.0, 0.0, z])) for z in (10.0, -10.0))
    assert upper < 1.0 < lower
    # It reaches as far as its points at the sides, and through the ends.
    wide = float(np.abs(made.radii() * sphere().points[:, 0]).max())
    assert wide == pytest.approx(22.0, abs=0.7)
    assert made.level_of(np.array([[0.0, 0.0, 20.0], [0.0, 0.0, -20.0]])) == pytest.approx([1.0, 1.0])
    assert ellipsoid_of(_points_of(SHEAR)).taper == pytest.approx(0.0)


def test_points_at_corners_still_give_an_ellipsoid() -> None:
    """Six points in two opposite corners of a box: the tilts contradict one another."""
    semi = np.array([20.0, 15.0, 18.0])
    points = np.array([[20, 15, 18], [20, 15, 18], [20, 15, 18], [-20, -15, -18], [-20, -15, -18], [-20, -15, -18]])
    made = ellipsoid_of(CENTRE + points)
    assert made.semi == pytest.approx(semi)
    assert np.linalg.eigvalsh(made.matrix).min() > 0.0
    assert np.isfinite(made.radii()).all()


def test_an_absent_model_is_named_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "totalsegmentator.map_to_binary", None)
    with pytest.raises(InputError, match="pip install TotalSegmentator"):
        learned_masks(scan(), "totalsegmentator")
    with pytest.raises(InputError, match="known are totalsegmentator, monai"):
        learned_masks(scan(), "guess")
    assert learned_masks(scan(), None) == {}


def test_an_installed_model_goes_through_the_same_door(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stand-in for TotalSegmentator that answers with the truth: it must be handed the scan in its own coordinates."""
    names, api = ModuleType("map_to_binary"), ModuleType("python_api")
    names.class_map = {"total": {22: "prostate", 21: "urinary_bladder"}}  # type: ignore[attr-defined]
    asked: list[Any] = []

    def stand_in(image: nibabel.Nifti1Image, output: None, **options: Any) -> nibabel.Nifti1Image:
        asked.append(image)
        labels = np.where(truth_of(BLADDER).array, 21, 0) + np.where(truth_of(1, 2).array, 22, 0)
        return nibabel.Nifti1Image(labels.astype(np.uint8), image.affine)

    api.totalsegmentator = stand_in  # type: ignore[attr-defined]
    for name, module in (("", ModuleType("totalsegmentator")), (".map_to_binary", names), (".python_api", api)):
        monkeypatch.setitem(sys.modules, f"totalsegmentator{name}", module)
    own = found()
    monkeypatch.setattr(pelvis, "make_scene", lambda ct, prompts, **whole: own.scene)
    for organ in own.organs:
        monkeypatch.setattr(organs_module, f"find_{organ}", lambda *a, kept=organ: own.organs[kept])
    organs = pelvis.segment_pelvis(scan(), model="totalsegmentator").organs
    ras = asked[0].affine @ [3.0, 4.0, 5.0, 1.0]
    assert ras[:3] == pytest.approx(scan().to_lps(np.array([[3.0, 4.0, 5.0]]))[0] * [-1.0, -1.0, 1.0])
    assert {name: organ.method for name, organ in organs.items()} == {
        "prostate": "totalsegmentator", "bladder": "totalsegmentator", "rectum": "auto",
    }  # fmt: skip
    # It is as sure as the picture alone agrees with it.
    assert 0.95 < organs["prostate"].confidence < 1.0


def test_the_study_says_what_is_wanted_and_what_is_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dice_module, "segment_pelvis", lambda ct, prompts: found())
    said = {"prostate": SurfaceErrors(found().scene.grid.to_lps(np.array([[20.0, 20.0, 20.0]])), np.array([2.5]), 0.7)}
    monkeypatch.setattr(dice_module, "surface_errors", lambda scene, prompts, organs: said)
    masks = {"prostate": truth_of(1, 2), "bladder": _shifted(truth_of(BLADDER), 12), "bone": truth_of(4)}
    study = segmentation_study([ContouredScan("made up", scan(), scan(), masks)])
    by = {(row["organ"], row["mode"]): row for row in study["rows"]}
    assert len(by) == 9
    assert by["prostate", "extremes"]["reached"] and not by["bladder", "extremes"]["reached"]
    assert by["bone", "auto"]["reached"] and by["prostate", "jittered"]["wanted"] is None
    assert study["wanted"] == 7 and study["reached"] == 4
    # Every mode gives the same here: there is nothing to tell apart.
    assert study["confidence_rank_correlation"] == {}
    assert by["prostate", "auto"]["said_mm"] == 2.5 and by["bladder", "auto"]["said_mm"] is None
    text = study_text(study)
    assert "said mm" in text and f"{2.5:9.1f}{by['prostate', 'auto']['true_mm']:9.1f}" in text
    assert text.count("not reached") == 3 and "made up" in text


def test_rank_correlation_is_one_where_the_surer_is_the_better() -> None:
    rows = [
        {"organ": "prostate", "confidence": sure, "dice": good} for sure, good in ((0.2, 0.5), (0.6, 0.7), (0.5, 0.6))
    ]
    assert rank_correlation(rows) == {"prostate": 1.0}
    assert rank_correlation([row | {"dice": -row["dice"]} for row in rows]) == {"prostate": -1.0}


def _shifted(mask: Volume, by: int) -> Volume:
    return mask.with_array(np.roll(mask.array, by, axis=0))


@pytest.mark.nightly
def test_a_real_pelvis_from_six_points(pelvis_small: Path) -> None:
    """Points off by 1.5 mm; the full table is `palpate validate segmentation`."""
    given = contoured_scan(pelvis_small / "CT", pelvis_small / "RTstructs.dcm", "scan 1")
    rows = segmentation_study([given], modes=("jittered",), errors=False)["rows"]
    reached = {row["organ"]: row["dice"] for row in rows}
    assert reached["prostate"] > 0.78
    assert reached["bladder"] > 0.92
    assert reached["rectum"] > 0.75
