"""A surface moved onto the edge that CT shows, finer than the voxels."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.volume import Volume
from palpate.segmentation.methods.optimal_surface import crossing
from palpate.segmentation.methods.surface_mesh import Shell, profiles, shell_of_mask
from palpate.segmentation.working_grid import Mask, blurred

STEP_MM = 0.25
# Noise is averaged over this width; wider, curved edges move inward.
BLUR_MM = 0.7
# A corner that a smooth guess cut off is won back a little in each round.
ROUNDS = 8


def moved_to_edges(
    ct: Volume, edge_hu: float, shell: Shell, reach_mm: float, rounds: int = ROUNDS
) -> tuple[Shell, float]:
    """The surface with every point moved along its normal onto the edge between soft tissue and fat, where there is one.

    ct : HU on an even grid, gas replaced by soft tissue. edge_hu : half-way from fat to soft tissue. reach_mm : largest distance
    of an edge. Points without an edge follow their neighbours. Returned with the share of points that have one.
    """
    sharp = ct.with_array(blurred(ct.array, BLUR_MM, float(ct.spacing[0])))
    seen = np.zeros(len(shell.points), dtype=bool)
    for number in range(rounds):
        reach = reach_mm if number == 0 else min(reach_mm, 1.5)
        found = _edge_offset(sharp, shell, reach, edge_hu)
        seen = np.isfinite(found)
        move = _followed(shell, found)
        shell = shell.moved(shell.points + move[:, None] * shell.normals)
    return shell, float(seen.mean())


def mask_to_edges(ct: Volume, edge_hu: float, mask: Mask, reach_mm: float) -> Mask:
    """A mask on the grid of `ct` with its outline moved onto the edges within reach; see `moved_to_edges`."""
    shell, _ = moved_to_edges(ct, edge_hu, shell_of_mask(mask, ct, 1.0), reach_mm)
    return shell.voxels(ct)


def _edge_offset(image: Volume, shell: Shell, reach_mm: float, level: float) -> FloatArray:
    """Offset (n,) mm along the normals to the nearest fall through ``level``; NaN where none is within reach."""
    offsets = np.arange(-reach_mm - STEP_MM, reach_mm + 1.5 * STEP_MM, STEP_MM)
    values = profiles(image, shell.points, shell.normals, offsets)
    middle = np.full(len(values), len(offsets) // 2)
    return offsets[0] + STEP_MM * crossing(values, middle, level, len(offsets))


def _followed(shell: Shell, found: FloatArray) -> FloatArray:
    """Moves (n,) mm: found ones as they are but for outliers; the others as their neighbours, fading with distance."""
    known = np.isfinite(found)
    move = np.where(known, found, 0.0)
    if not known.any():
        return move
    neighbours = shell.mean_of_neighbours @ move
    share = shell.mean_of_neighbours @ known.astype(float)
    usual = neighbours / np.maximum(share, 1e-6)
    known &= (share < 0.3) | (np.abs(move - usual) < 1.0)
    move = np.where(known, move, 0.0)
    for _ in range(8):
        move = np.where(known, move, 0.9 * (shell.mean_of_neighbours @ move))
    return shell.smoothed(move, 1)
