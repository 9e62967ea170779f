"""The course of the rectum: of all chains of discs, one a slice, the one that agrees best with picture, anatomy and itself.

The best chain is found exactly, by dynamic programming: no start is needed, and a lumen that is lost in one
slice is found again in the next.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from palpate.core.arrays import FloatArray, IntArray
from palpate.segmentation.rectum.course_options import CourseOptions
from palpate.segmentation.rectum.disc_scores import disc_scores
from palpate.segmentation.rectum.outlines import ANGLES, Track
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import Mask

# Centres are tried so far beside the midline, and between these distances behind the symphysis.
WIDE_MM, NEAREST_MM, FARTHEST_MM = 28.0, 20.0, 115.0


def course_of(
    scene: Scene,
    avoid: Mask,
    ends: tuple[float, float],
    point: FloatArray | None = None,
    options: CourseOptions | None = None,
) -> Track | None:
    """Heights, centres and radii of the rectum between two heights mm; None where nothing like one is there.

    avoid : other organs and bone. point : (3,) mm that the course passes.
    """
    options = options or CourseOptions()
    low, high = ends
    heights = np.arange(low + 0.5 * scene.step, high, options.step_mm)
    if len(heights) < 4:
        return None
    grid = _centres(scene, options, point)
    score = disc_scores(scene, avoid, heights, grid, options)
    if point is not None:
        k = int(np.abs(heights - point[2]).argmin())
        away = (grid[0][:, None] - point[0]) ** 2 + (grid[1][None, :] - point[1]) ** 2
        score[k] -= away[:, :, None] / options.step_mm**2
    total = score - options.place_weight * _unusual(scene, heights, grid, options)[..., None]
    chosen = _best_chain(total, options)
    at = (np.arange(len(heights)), *chosen.T)
    stretch = ndimage.uniform_filter1d(score[at], max(1, round(options.stretch_mm / options.step_mm)), mode="nearest")
    if point is None and float(stretch.max()) < options.least_score:
        return None
    centres = np.column_stack([grid[0][chosen[:, 0]], grid[1][chosen[:, 1]]])
    radii = np.array(options.radii_mm)[chosen[:, 2]]
    return Track(heights, centres, np.repeat(radii[:, None], ANGLES, axis=1))


def _centres(scene: Scene, options: CourseOptions, point: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    """Coordinates x and y mm of the centres that are tried."""
    x, y, _ = (a.ravel() for a in scene.axes())
    front = scene.pelvis.symphysis
    middle = scene.pelvis.midline_x(front[1, 1] + options.behind_mm[0], front[:, 2].mean())
    low = np.array([middle - WIDE_MM, front[1, 1] + NEAREST_MM])
    high = np.array([middle + WIDE_MM, front[1, 1] + FARTHEST_MM])
    if point is not None:
        low, high = np.minimum(low, point[:2]), np.maximum(high, point[:2])
    low, high = np.maximum(low, [x[0], y[0]]), np.minimum(high, [x[-1], y[-1]])
    across, along = (np.arange(a, b + 1e-6, options.step_mm) for a, b in zip(low, high, strict=True))
    return across, along


def _unusual(
    scene: Scene, heights: FloatArray, grid: tuple[FloatArray, FloatArray], options: CourseOptions
) -> FloatArray:
    """How unusual centres (n, x, y) are: ln (1 + d^2), d the distance in spreads; heavy tails, since flexures leave the usual place."""
    x, y = grid
    front, sacrum = scene.pelvis.symphysis, scene.pelvis.sacrum
    beside = np.array([[scene.pelvis.midline_x(v, z) for v in y] for z in heights])
    off = ((x[None, :, None] - beside[:, None, :]) / options.beside_sd_mm) ** 2
    for k, z in enumerate(heights):
        near = sacrum[np.abs(sacrum[:, 2] - z) < 4.0] if len(sacrum) else sacrum
        usual, spread = options.behind_mm if len(near) == 0 else options.before_bone_mm
        place = front[1, 1] + usual if len(near) == 0 else float(near[:, 1].min()) - usual
        off[k] += ((y[None, :] - place) / spread) ** 2
    return np.log1p(off)


def _best_chain(total: FloatArray, options: CourseOptions) -> IntArray:
    """Indices (n, 3) of centre and radius by height, of the largest sum of scores (n, x, y, r) less the cost of moves."""
    usual, most = (v / options.step_mm for v in options.move_mm)
    reach = int(most)
    moves = [
        (i, j, r, options.move_weight * ((i * i + j * j) / usual**2 + r * r))
        for i in range(-reach, reach + 1)
        for j in range(-reach, reach + 1)
        for r in (-1, 0, 1)
        if i * i + j * j <= most**2
    ]
    best, back = total[0], []
    for now in total[1:]:
        found, which = np.full(now.shape, -np.inf), np.zeros(now.shape, dtype=int)
        for number, (i, j, r, cost) in enumerate(moves):
            came = _shifted(best, (i, j, r)) - cost
            better = came > found
            found, which = np.where(better, came, found), np.where(better, number, which)
        best = found + now
        back.append(which)
    at = list(np.unravel_index(int(best.argmax()), best.shape))
    chain = [at]
    for which in reversed(back):
        move = moves[which[tuple(at)]]
        at = [int(a) - m for a, m in zip(at, move[:3], strict=True)]
        chain.append(at)
    return np.array(chain[::-1])


def _shifted(values: FloatArray, by: tuple[int, int, int]) -> FloatArray:
    """Values moved by whole cells; minus infinity where nothing came from."""
    out = np.full(values.shape, -np.inf)
    into = tuple(slice(max(0, b), n + min(0, b)) for b, n in zip(by, values.shape, strict=True))
    from_ = tuple(slice(max(0, -b), n + min(0, -b)) for b, n in zip(by, values.shape, strict=True))
    out[into] = values[from_]
    return out
