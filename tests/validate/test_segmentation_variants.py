"""Variants of a contoured scan: each change is what its recipe says, the contours go along, and the table counts failures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.validate.segmentation import variant_study as study
from palpate.validate.segmentation.contoured_scan import ContouredScan
from palpate.validate.segmentation.dice import DiceRow
from palpate.validate.segmentation.variants import SOFT_HU, Recipe, drawn_recipe, variant_of

SPACING = np.array([2.0, 2.0, 2.5])


@pytest.fixture
def scan() -> ContouredScan:
    """A fat block with a prostate in it and a bladder above, off the middle on every axis."""
    affine = np.diag([*SPACING, 1.0])
    affine[:3, 3] = (-40.0, -30.0, -50.0)
    labels = np.zeros((40, 36, 40), dtype=np.uint8)
    labels[16:22, 12:20, 12:18] = 1
    labels[10:16, 12:20, 12:18] = 2
    labels[8:26, 10:22, 22:30] = 5
    hu = np.where(labels == 5, 5, np.where(labels > 0, 35, -100)).astype(np.int16)
    grid = Volume(labels, affine)
    masks = {"prostate": grid.with_array((labels == 1) | (labels == 2)), "bladder": grid.with_array(labels == 5)}
    return ContouredScan("block", grid.with_array(hu), grid, masks)


def centre(mask: Volume) -> np.ndarray:
    return mask.to_lps(np.argwhere(mask.array).astype(float)).mean(axis=0)


def test_an_empty_recipe_changes_nothing(scan: ContouredScan) -> None:
    same = variant_of(scan, Recipe(), 1)
    np.testing.assert_array_equal(same.ct.array, scan.ct.array)
    np.testing.assert_array_equal(same.labels.array, scan.labels.array)
    np.testing.assert_allclose(same.ct.affine, scan.ct.affine)


def test_slices_of_another_thickness_keep_the_organs_where_they_are(scan: ContouredScan) -> None:
    thick = variant_of(scan, Recipe(slice_mm=5.0), 1)
    assert thick.ct.spacing[2] == pytest.approx(5.0)
    for name in ("prostate", "bladder"):
        np.testing.assert_allclose(centre(thick.masks[name]), centre(scan.masks[name]), atol=2.5)


def test_a_cut_field_ends_where_the_recipe_says(scan: ContouredScan) -> None:
    cut = variant_of(scan, Recipe(below_mm=15.0, above_mm=10.0), 1)
    z = cut.ct.to_lps(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, cut.ct.array.shape[2] - 1.0]]))[:, 2]
    organs = scan.ct.to_lps(np.argwhere(scan.labels.array > 0).astype(float))[:, 2]
    assert z[0] == pytest.approx(organs.min() - 15.0)
    assert organs.max() + 7.0 < z[1] <= organs.max() + 10.0


def test_left_and_right_change_places_and_halves_keep_their_side(scan: ContouredScan) -> None:
    turned = variant_of(scan, Recipe(mirrored=True), 1)
    middle = 2.0 * scan.ct.to_lps(np.array([[19.5, 0.0, 0.0]]))[0, 0]
    assert centre(turned.masks["prostate"])[0] == pytest.approx(middle - centre(scan.masks["prostate"])[0])
    left, right = (centre(turned.labels.with_array(turned.labels.array == value))[0] for value in (1, 2))
    assert left > right


def test_fat_contrast_scale_and_noise_are_those_of_the_recipe(scan: ContouredScan) -> None:
    lean = variant_of(scan, Recipe(fat=0.0), 1).ct.array
    assert lean[20, 16, 20] == SOFT_HU
    thinner = variant_of(scan, Recipe(fat=0.5), 1).ct.array
    assert thinner[22, 16, 15] > 0.5 * SOFT_HU  # 2 mm beside the prostate
    assert thinner[30, 16, 15] == scan.ct.array[30, 16, 15]
    bright = variant_of(scan, Recipe(contrast_hu=250.0), 1).ct.array
    assert bright[16, 16, 26] > 200
    assert bright[19, 16, 15] == pytest.approx(scan.ct.array[19, 16, 15], abs=0.5)
    scaled = variant_of(scan, Recipe(scale=1.05, offset_hu=-10.0), 1).ct.array
    assert scaled[19, 16, 15] == pytest.approx(35 - 10 + 0.05 * 1025, abs=1)
    noise = variant_of(scan, Recipe(noise_hu=20.0), 5).ct.array - scan.ct.array
    assert noise.std() == pytest.approx(20.0, rel=0.02)
    np.testing.assert_array_equal(noise, variant_of(scan, Recipe(noise_hu=20.0), 5).ct.array - scan.ct.array)


def test_recipes_are_drawn_anew_and_again_with_their_seed() -> None:
    drawn = [drawn_recipe(np.random.default_rng(seed)) for seed in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]


def test_the_table_counts_what_was_not_found_and_what_pointing_made_worse(
    scan: ContouredScan, monkeypatch: pytest.MonkeyPatch
) -> None:
    def table(
        ct: Volume, reference: dict[str, Volume], modes: tuple[str, ...], seed: int, errors: bool
    ) -> list[DiceRow]:
        if modes == ("extremes",):
            raise InputError("no pubic bones")
        good = DiceRow("prostate", modes[0], 0.8, 0.8, 40.0, 50.0, 1.0, 0.6, said_mm=3.0, true_mm=2.0)
        return [replace(good, dice=0.7) if modes == ("click",) else good]

    monkeypatch.setattr(study, "dice_table", table)
    found = study.variant_study([scan], 3, seed=1)
    assert found["worse_than_auto"] == 6  # click and extremes of the prostate, each in three variants
    by = {(row["organ"], row["mode"]): row for row in found["summary"]}
    assert by["prostate", "auto"]["worst_tenth"] == 0.8 and by["prostate", "auto"]["said_over_true"] == 1.5
    assert by["prostate", "extremes"]["said_over_true"] is None
    assert by["prostate", "extremes"]["not_found"] == 3
    assert by["bladder", "auto"]["not_found"] == 3
    assert "no pubic bones" in {row["failed"] for row in found["rows"]}
    assert "worst tenth" in study.variant_text(found)
