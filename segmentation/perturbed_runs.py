"""The segmentation run again on slightly other input: noise, blur, HU, landmarks, points and a coarser grid.

Where the surface then lies elsewhere the picture does not hold it. The spread is no error by itself: what all runs do
wrongly they do alike. `surface_error` makes an error of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy import ndimage

from palpate.core.arrays import FloatArray
from palpate.core.sourced_number import sourced
from palpate.imaging.volume import Volume
from palpate.segmentation.organs import find_organs
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.search_region import Found, Scene
from palpate.segmentation.working_grid import GAS_HU, bounds, gas_filled, mask_on, resampled, upright


@dataclass(frozen=True, kw_only=True)
class PerturbationOptions:
    """How the input is changed."""

    runs: Annotated[
        int, sourced("1", "Runs beside the one that is kept.", "Chosen: each takes a quarter of its time.")
    ] = 3
    step_mm: Annotated[
        float, sourced("mm", "Spacing of the runs' grid.", "Chosen: coarse enough to be quick, finer than most slices.")
    ] = 2.0
    noise: Annotated[
        float, sourced("1", "Noise that is added, over the scan's own.", "Chosen: as much again as the scan has.")
    ] = 1.0
    blur_mm: Annotated[
        float, sourced("mm", "Largest further blur (standard deviation).", "Chosen: from a sharp to a soft kernel.")
    ] = 0.8
    offset_hu: Annotated[
        float, sourced("HU", "Standard deviation of an offset of all HU.", "Chosen: what scanners differ by in water.")
    ] = 6.0
    landmark_mm: Annotated[
        float, sourced("mm an axis", "Standard deviation of the landmarks' place.", "Chosen: error of the symphysis.")
    ] = 3.0
    click_mm: Annotated[
        float, sourced("mm an axis", "Standard deviation of a click's place.", "Chosen: a click is put in by eye.")
    ] = 3.0
    point_mm: Annotated[
        float,
        sourced("mm an axis", "Standard deviation of an extreme point.", "Chosen: as `validate segmentation` jitters."),
    ] = 1.5


def perturbed_organs(
    scene: Scene, prompts: Prompts, given: Mapping[str, Found], seed: int, options: PerturbationOptions | None = None
) -> list[dict[str, Volume]]:
    """Masks of the organs that each run finds, on its own grid. given : organs that are not sought. Same seed, same runs."""
    options = options or PerturbationOptions()
    out = []
    for number in range(options.runs):
        random = np.random.default_rng((seed, number))
        other = _changed(scene, random, options)
        kept = {
            name: replace(found, mask=mask_on(scene.grid.with_array(found.mask), other.grid))
            for name, found in given.items()
        }
        organs = find_organs(other, _moved(prompts, random, options), kept)
        out.append({name: other.grid.with_array(found.mask) for name, found in organs.items()})
    return out


def scan_noise_hu(scene: Scene) -> float:
    """Standard deviation of the voxels' noise within soft tissue, HU: from second differences along x (Immerkaer 1996)."""
    soft = (scene.hu > 0.0) & (scene.hu < 100.0) & scene.body
    flat = soft[2:] & soft[1:-1] & soft[:-2]
    second = (scene.hu[2:] - 2.0 * scene.hu[1:-1] + scene.hu[:-2])[flat]
    return 0.0 if len(second) == 0 else float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0))


def _changed(scene: Scene, random: np.random.Generator, options: PerturbationOptions) -> Scene:
    """The scene as another scan of the same patient would show it, on a coarser grid that is shifted."""
    low, high = bounds(scene.grid)
    grid = upright(low + random.uniform(0.0, options.step_mm, 3), high, options.step_mm)
    # Noise of the voxels that a coarser grid averages over is less by the root of their number.
    noise = options.noise * scan_noise_hu(scene) * (scene.step / options.step_mm) ** 1.5
    sigma = random.uniform(0.0, options.blur_mm) / scene.step
    soft = ndimage.gaussian_filter(scene.hu, sigma) if sigma > 0.0 else scene.hu
    hu = resampled(scene.grid.with_array(soft), grid, smooth=False).array
    tissue = hu > GAS_HU
    change = random.normal(0.0, noise, hu.shape) + random.normal(0.0, options.offset_hu)
    hu = (hu + np.where(tissue, change, 0.0)).astype(np.float32)
    body, bone = (mask_on(scene.grid.with_array(mask), grid) for mask in (scene.body, scene.bone))
    filled, gas = gas_filled(hu, options.step_mm)
    pelvis = replace(scene.pelvis, symphysis=scene.pelvis.symphysis + random.normal(0.0, options.landmark_mm, 3))
    return replace(scene, grid=grid, hu=hu, filled=filled, gas=gas & body, body=body, bone=bone, pelvis=pelvis)


def _moved(prompts: Prompts, random: np.random.Generator, options: PerturbationOptions) -> Prompts:
    def near(points: FloatArray, sd: float) -> FloatArray:
        return np.asarray(points + random.normal(0.0, sd, np.shape(points)))

    boxes = {name: np.sort(near(box, options.point_mm), axis=0) for name, box in prompts.boxes.items()}
    return replace(
        prompts,
        seeds={name: near(point, options.click_mm) for name, point in prompts.seeds.items()},
        extremes={name: near(points, options.point_mm) for name, points in prompts.extremes.items()},
        boxes=boxes,
    )
