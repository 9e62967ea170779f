"""How well discs of all places and sizes agree with the picture: soft tissue or gas within, fat or other organs about them."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from palpate.core.arrays import Float32Array, FloatArray
from palpate.segmentation.rectum.course_options import CourseOptions
from palpate.segmentation.rectum.gas_sections import in_front_of_gas, large_gas
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import GAS_HU, Mask, blurred

# Ring about a disc in which its surroundings are looked at, mm beyond its radius.
RING_MM = (1.5, 6.0)


def disc_scores(
    scene: Scene, avoid: Mask, heights: FloatArray, grid: tuple[FloatArray, FloatArray], options: CourseOptions
) -> FloatArray:
    """How well discs (n, x, y, r) agree with the picture: 1 for soft tissue with fat all about it, more where gas fills it."""
    x, y = grid
    room = int(np.ceil((max(options.radii_mm) + RING_MM[1] + options.levator_mm) / options.step_mm))
    wide = [_widened(axis, room, options.step_mm) for axis in grid]
    points = np.stack(np.meshgrid(heights, *wide, indexing="ij"), axis=-1)[..., [1, 2, 0]]
    index = scene.grid.to_index(points.reshape(-1, 3)).T
    like, gas = (
        ndimage.map_coordinates(array, index, order=1, mode="nearest").reshape(points.shape[:3])
        for array in _likeness(scene, avoid)
    )
    take = (slice(None), slice(room, room + len(x)), slice(room, room + len(y)))
    muscle = heights < scene.pelvis.symphysis[:, 2].mean()
    scores = [_of_one_size(like, gas, radius, muscle, options)[take] for radius in options.radii_mm]
    return np.stack(scores, axis=-1)


def _widened(axis: FloatArray, room: int, step: float) -> FloatArray:
    return np.asarray(axis[0] + step * np.arange(-room, len(axis) + room))


def _of_one_size(like: FloatArray, gas: FloatArray, radius: float, muscle: Mask, options: CourseOptions) -> FloatArray:
    """Scores of discs of one radius about every place (n, x, y). muscle : (n,) heights at which levator and sphincter lie about them."""
    disc, near, beyond = (_template(radius, options.step_mm, gap) for gap in (None, 0.0, options.levator_mm))
    around, left_out = (np.where(muscle[:, None, None], _mean(m, beyond), _mean(m, near)) for m in (like, gas))
    usual, spread = options.usual_mm
    # The root: a bubble says as much of where a lumen is as gas of many times its area.
    held = np.sqrt(np.clip(_mean(gas, disc) * (radius / usual) ** 2, 0.0, 1.0))
    gain = held - np.sqrt(np.clip(left_out, 0.0, 1.0))
    odd = (np.log(radius / usual) / spread) ** 2
    return 0.5 * (_mean(like, disc) - around) + options.gas_weight * gain - options.place_weight * odd


def _mean(values: FloatArray, kernel: FloatArray) -> FloatArray:
    """Means over a kernel about each place of every slice."""
    from scipy import signal  # with all of scipy.stats: too slow to import for a command that draws no organ

    return np.asarray(signal.fftconvolve(values, kernel[None], mode="same", axes=(1, 2)))


def _template(radius: float, step: float, beyond: float | None) -> FloatArray:
    """Mean over a disc, or over the ring that begins so far beyond it, as a kernel."""
    n = int(np.ceil((radius + RING_MM[1] + (beyond or 0.0)) / step))
    away = step * np.hypot(*np.mgrid[-n : n + 1, -n : n + 1]) - radius
    if beyond is None:
        part = np.clip(0.5 - away / step, 0.0, 1.0)
    else:
        part = ((away >= RING_MM[0] + beyond) & (away <= RING_MM[1] + beyond)).astype(float)
    return np.asarray(part / part.sum())


def _likeness(scene: Scene, avoid: Mask) -> tuple[Float32Array, Float32Array]:
    """1 for soft tissue and gas, -1 for fat, other organs and what lies in front of gas; and the gas."""
    soft = np.clip((scene.filled - scene.fat_edge) / 40.0, -1.0, 1.0)
    # Noise makes gas of single voxels of fat.
    gas = scene.gas & (blurred(scene.hu, 1.0, scene.step) < GAS_HU) & ~avoid
    blocked = (avoid | in_front_of_gas(scene, large_gas(gas, scene.step))) & ~gas
    like = np.where(blocked, -1.0, soft)
    return blurred(like, 1.0, scene.step), blurred(gas.astype(np.float32), 1.0, scene.step)
