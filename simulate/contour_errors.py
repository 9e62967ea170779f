"""Contours with the errors of a person: smooth, correlated, independent for each organ."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from scipy import ndimage

from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.labels import BLADDER, ORGAN_LABELS, OUTSIDE, RECTUM, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.simulate.source import labels_on

# What a person contours; bone and the modelled region are not.
_CONTOURED = (ORGAN_LABELS, (BLADDER,), (RECTUM,))
_STEP_MM = 2.0


def labels_with_contour_errors(
    labels: Callable[[FloatArray], LabelArray],
    grid: Volume,
    noise_sd_mm: float,
    correlation_mm: float,
    rng: np.random.Generator,
) -> Volume:
    """Labels on a grid, their contours displaced at random.

    labels : label (n,) of points (n, 3) mm. noise_sd_mm : standard deviation of the displacement along any direction,
    so along the normal; its correlation over a distance d is exp(-d^2 / (2 correlation_mm^2)).
    """
    if noise_sd_mm == 0.0:
        return labels_on(labels, grid)
    fields = ((members, random_field(grid, noise_sd_mm, correlation_mm, rng)) for members in _CONTOURED)
    return displaced_labels(labels, grid, fields)


def displaced_labels(
    labels: Callable[[FloatArray], LabelArray],
    grid: Volume,
    fields: Iterable[tuple[tuple[int, ...], Callable[[FloatArray], FloatArray]]],
) -> Volume:
    """Labels on a grid, each structure's contour displaced by a field of its own.

    fields : labels of a structure, and the displacement (n, 3) mm beside each point (n, 3) at which its label is asked for. Where two
    structures would lie, the one named first does; what is left bare is surrounding tissue.
    """
    clean, pairs = labels_on(labels, grid), list(fields)
    drawn = [label for members, _ in pairs for label in members]
    result = np.where(np.isin(clean.array, drawn), SURROUNDING_TISSUE, clean.array)
    for members, field in pairs:
        moved = _displaced(labels, clean, members, field)
        mine = np.isin(moved, members) & (result == SURROUNDING_TISSUE)
        result[mine] = moved[mine]
    return grid.with_array(result.astype(np.uint8))


def random_field(
    grid: Volume, sd_mm: float, correlation_mm: float, rng: np.random.Generator
) -> Callable[[FloatArray], FloatArray]:
    """A smooth random vector field (n, 3) mm over the box of a grid, each component of standard deviation ``sd_mm``."""
    extent = grid.spacing * np.array(grid.array.shape)
    step = max(_STEP_MM, correlation_mm / 4.0)
    shape = np.ceil(extent / step).astype(int) + 1
    # A Gaussian of width s correlates white noise as exp(-d^2 / (4 s^2)).
    sigma = correlation_mm / np.sqrt(2.0) / step
    margin = int(np.ceil(3.0 * sigma))
    components = []
    for _ in range(3):
        noise = ndimage.gaussian_filter(rng.standard_normal(tuple(shape + 2 * margin)), sigma)
        kernel_norm = (2.0 * np.sqrt(np.pi) * sigma) ** 1.5
        components.append(sd_mm * kernel_norm * noise[tuple(slice(margin, -margin) for _ in range(3))])

    def at(points: FloatArray) -> FloatArray:
        index = (grid.to_index(points) * grid.spacing / step).T
        return np.stack([ndimage.map_coordinates(c, index, order=1, mode="nearest") for c in components], axis=1)

    return at


def _displaced(
    labels: Callable[[FloatArray], LabelArray],
    clean: Volume,
    members: tuple[int, ...],
    field: Callable[[FloatArray], FloatArray],
) -> LabelArray:
    """Labels asked beside each voxel centre by the random displacement, near the given labels only. What would be asked beyond the
    modelled region keeps its label: the region's edge is nobody's contour.
    """
    near = ndimage.binary_dilation(np.isin(clean.array, members), iterations=5)
    result = np.full(clean.array.shape, OUTSIDE, dtype=np.uint8)
    points = clean.to_lps(np.argwhere(near).astype(np.float64))
    found = labels(points + field(points)) if len(points) else np.zeros(0, dtype=np.uint8)
    result[near] = np.where(found == OUTSIDE, clean.array[near], found)
    return result
