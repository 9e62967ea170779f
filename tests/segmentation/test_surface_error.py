"""How far a surface may be off: what perturbed runs do, where the picture has no edge, and the Dice that follows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from organ_scans import found

from palpate.imaging.volume import Volume
from palpate.segmentation import organs as organs_module
from palpate.segmentation import perturbed_runs
from palpate.segmentation.error_estimate import MOST_MM, Clues, ErrorNumbers, error_models
from palpate.segmentation.methods.star_surface import star
from palpate.segmentation.methods.surface_mesh import shell_of_mask
from palpate.segmentation.organs import confirms, find_organs
from palpate.segmentation.perturbed_runs import PerturbationOptions, perturbed_organs, scan_noise_hu
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.search_region import Found, Scene
from palpate.segmentation.surface_error import (
    clues_of,
    errors_of,
    expected_dice,
    spread_points,
    surface_errors,
)
from palpate.segmentation.working_grid import signed_distance

STEP = 1.25


def grid() -> Volume:
    affine = np.diag([STEP, STEP, STEP, 1.0])
    affine[:3, 3] = (-30.0, -28.0, -26.0)
    return Volume(np.zeros((48, 48, 48), dtype=np.uint8), affine)


def ball(radius: float, centre: tuple[float, float, float] = (1.0, 2.0, 3.0)) -> np.ndarray:
    index = np.indices((48, 48, 48)).reshape(3, -1).T.astype(float)
    return (np.linalg.norm(grid().to_lps(index) - centre, axis=1) < radius).reshape(48, 48, 48)


@pytest.fixture
def scene() -> Scene:
    """A ball of soft tissue that lies in fat on the left (x > 1) and in soft tissue on the right."""
    x = grid().affine[0, 3] + STEP * np.arange(48)
    hu = np.where(ball(16.0), 40.0, np.where(x[:, None, None] > 1.0, -100.0, 40.0)).astype(np.float32)
    nothing = np.zeros(hu.shape, dtype=bool)
    made = found().scene
    return replace(made, grid=grid(), hu=hu, filled=hu, gas=nothing, body=~nothing, bone=nothing)


def test_runs_that_lie_elsewhere_and_missing_edges_are_clues(scene: Scene) -> None:
    organ = Found(ball(16.0), "auto", 0.9)
    shell = shell_of_mask(organ.mask, scene.grid, 1.0)
    chosen = spread_points(shell, scene.grid)
    runs = [grid().with_array(ball(16.0 + wider)) for wider in (2.0, -2.0)]
    clues = clues_of(scene, shell, chosen, organ, runs)
    np.testing.assert_allclose(clues.local, 2.0, atol=0.4)
    np.testing.assert_allclose(clues.whole, 2.0, atol=0.2)
    left, right = shell.points[chosen][:, 0] > 9.0, shell.points[chosen][:, 0] < -7.0
    assert clues.weak[left].max() < 0.35 and clues.weak[right].min() > 0.65
    lost = clues_of(scene, shell, chosen, organ, [runs[0], None, None])
    assert (lost.local > 0.9 * MOST_MM).all()
    nearer = [runs[0], grid().with_array(ball(16.5))]
    np.testing.assert_allclose(  # a run that found no organ says nothing of where it is
        clues_of(scene, shell, chosen, organ, [*nearer, None]).local,
        clues_of(scene, shell, chosen, organ, nearer).local,
    )


def test_what_is_not_held_by_the_picture_may_be_farther_off(scene: Scene) -> None:
    organ, model = Found(ball(16.0), "auto", 0.9), error_models()["prostate"]
    steady, unsteady = (errors_of(scene, organ, [grid().with_array(ball(16.0 + wider))], model) for wider in (0.0, 4.0))
    assert unsteady.sd_mm.mean() > 1.3 * steady.sd_mm.mean() and unsteady.expected_dice < steady.expected_dice
    left, right = steady.points[:, 0] > 9.0, steady.points[:, 0] < -7.0
    assert steady.sd_mm[right].mean() > 1.1 * steady.sd_mm[left].mean()


def test_the_expected_dice_is_that_of_drawn_errors() -> None:
    shell = star(np.zeros(3), np.full(642, 20.0))
    chosen, random = np.arange(642), np.random.default_rng(2)
    sd = np.where(shell.points[:, 2] > 0.0, 2.0, 1.0)
    volume = Volume(
        np.zeros((80, 80, 80), dtype=np.uint8),
        np.array([[0.7, 0, 0, -28], [0, 0.7, 0, -28], [0, 0, 0.7, -28], [0, 0, 0, 1.0]]),
    )
    true = shell.voxels(volume)
    factor = np.linalg.cholesky(
        np.exp(-0.5 * ((shell.points[:, None] - shell.points) ** 2).sum(-1) / 8.0**2) + 1e-6 * np.eye(642)
    )
    dices = []
    for _ in range(30):
        other = star(np.zeros(3), 20.0 + sd * (factor @ random.standard_normal(642))).voxels(volume)
        dices.append(2.0 * (true & other).sum() / (true.sum() + other.sum()))
    assert expected_dice(shell, chosen, sd) == pytest.approx(np.mean(dices), abs=0.01)


def test_the_distance_is_signed_and_of_the_outline() -> None:
    distance = signed_distance(ball(16.0), grid())
    at = np.array([[5.0, 2.0, 3.0], [21.0, 2.0, 3.0], [17.0, 2.0, 3.0]])
    np.testing.assert_allclose(distance.at(at), [-12.0, 4.0, 0.0], atol=0.7)
    assert np.isposinf(signed_distance(np.zeros((4, 4, 4), dtype=bool), grid()).array).all()


def _by_threshold(scene: Scene, prompts: Prompts, given: Mapping[str, Found], *_: Any) -> dict[str, Found]:
    return {**given, "prostate": Found(scene.hu > scene.fat_edge, "auto", 0.5)}


def test_runs_are_drawn_by_their_seed_and_leave_given_organs_alone(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(perturbed_runs, "find_organs", _by_threshold)
    given = {"bladder": Found(ball(6.0), "user", 1.0)}
    first, again, other = (
        perturbed_organs(scene, Prompts(), given, seed, PerturbationOptions(runs=2)) for seed in (1, 1, 2)
    )
    assert len(first) == 2 and set(first[0]) == {"bladder", "prostate"}
    for one, two in zip(first, again, strict=True):
        np.testing.assert_array_equal(one["prostate"].array, two["prostate"].array)
        np.testing.assert_array_equal(one["prostate"].affine, two["prostate"].affine)
    assert not np.allclose(first[0]["prostate"].affine, other[0]["prostate"].affine)
    assert first[0]["bladder"].array.sum() * 8.0 == pytest.approx(ball(6.0).sum() * STEP**3, rel=0.15)


def test_organs_of_a_person_or_a_model_are_left_out(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(perturbed_runs, "find_organs", _by_threshold)
    organs = {"prostate": Found(ball(16.0), "auto", 0.9), "bladder": Found(ball(6.0), "user", 1.0)}
    assert set(surface_errors(scene, Prompts(), organs)) == {"prostate"}
    assert surface_errors(scene, Prompts(), {"prostate": Found(ball(16.0), "monai", 0.9)}) == {}


def test_noise_of_a_scan(scene: Scene) -> None:
    noisy = replace(scene, hu=scene.hu + np.random.default_rng(1).normal(0.0, 12.0, scene.hu.shape).astype(np.float32))
    assert scan_noise_hu(noisy) == pytest.approx(12.0, rel=0.15)


def test_points_that_were_given_make_an_organ_surer() -> None:
    one = np.ones(3)
    for name, model in error_models(ErrorNumbers()).items():
        auto, pointed = (
            model.sd_mm(Clues(one, one, 0.5 * one, 0.5 * one, 20.0 * one, p * one, 0.7 * one)) for p in (0.0, 1.0)
        )
        assert (pointed <= auto).all(), name


@pytest.mark.parametrize(
    ("place", "kept"), [((1.0, 2.0, 3.0), True), ((15.0, 2.0, 3.0), False), ((25.0, 2.0, 3.0), False)]
)
def test_a_click_deep_inside_confirms_what_is_found_without(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, place: tuple[float, float, float], kept: bool
) -> None:
    def find(scene: Scene, prompts: Prompts, taken: object) -> Found:
        return Found(ball(16.0) if prompts.mode("bladder") == "auto" else ball(8.0), prompts.mode("bladder"), 0.5)

    monkeypatch.setattr(organs_module, "find_bladder", find)
    given = {"rectum": Found(ball(3.0), "user", 1.0), "prostate": Found(ball(3.0), "user", 1.0)}
    led = find_organs(scene, Prompts({"bladder": np.array(place)}), given)["bladder"]
    assert led.method == "click" and led.mask.sum() == ball(16.0 if kept else 8.0).sum()


@pytest.mark.parametrize(("off", "kept"), [(0.5, True), (3.0, False)])
def test_points_on_the_surface_confirm_it(scene: Scene, off: float, kept: bool) -> None:
    middle, out = np.array([1.0, 2.0, 3.0]), 16.0 + off
    points = np.concatenate([middle - out * np.eye(3), middle + out * np.eye(3)])
    assert confirms(scene, ball(16.0), Prompts({}, {"bladder": points}), "bladder") is kept
