"""Bone: cortex by hysteresis, marrow by closing and filling; medium in a bladder is none."""

from __future__ import annotations

import numpy as np
import SimpleITK as sitk
from scipy import ndimage
from skimage.filters import apply_hysteresis_threshold

from palpate.imaging.volume import Volume
from palpate.segmentation.bone.medium import medium_mask
from palpate.segmentation.working_grid import Mask, filled

# Cortex reaches the higher level somewhere in every bone; the lower one is half-way from muscle to cortex.
SURE_HU, EDGE_HU = 260.0, 110.0
SMALLEST_CC = 2.0
# Thin cortex and trabeculae leave gaps about this wide. Joint spaces and the symphysis close as well: they are as
# rigid as bone here.
CLOSING_MM = 3.0
# Marrow has bone on both sides, this near, along most of the 13 lines through a voxel and its neighbours. Where cortex
# is too thin to be seen (femoral heads of the old) this still tells inside from outside.
REACH_MM = 30.0
LINES = 8


def bone_mask(ct: Volume) -> Mask:
    """Mask of bone with its marrow. ct : HU on an even grid, about 2 mm, everything but the body set to air."""
    step = float(ct.spacing[0])
    dense = apply_hysteresis_threshold(ct.array, EDGE_HU, SURE_HU)
    dense &= ~medium_mask(ct.array, dense, step)
    dense = _large_pieces(dense, SMALLEST_CC * 1000.0 / step**3)
    if not dense.any():
        return dense
    used = ndimage.find_objects(dense.astype(np.uint8))[0]
    result = np.zeros_like(dense)
    marrow = _between_bone(dense[used], step)
    result[used] = _filled(_closed(dense[used] | marrow, step))
    return result


def _between_bone(dense: Mask, step: float) -> Mask:
    """Voxels that have bone within reach on both sides along at least ``LINES`` of 13 lines."""
    count = np.zeros(dense.shape, dtype=np.uint8)
    for line in [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)]:
        if line > (0, 0, 0):
            steps = max(1, int(REACH_MM / (step * np.linalg.norm(line))))
            opposite = tuple(-x for x in line)
            count += _seen(dense, line, steps) & _seen(dense, opposite, steps)
    return count >= LINES


def _seen(dense: Mask, direction: tuple[int, ...], steps: int) -> Mask:
    """Whether bone lies within ``steps`` voxels in a direction."""
    seen = dense.copy()
    done = 1
    while done < steps:
        shift = min(done, steps - done)
        seen |= _shifted(seen, tuple(shift * d for d in direction))
        done += shift
    return seen


def _shifted(mask: Mask, by: tuple[int, ...]) -> Mask:
    """The mask as seen from voxels ``by`` before it; False beyond the grid."""
    moved = np.zeros_like(mask)
    if any(abs(b) >= n for b, n in zip(by, mask.shape, strict=True)):
        return moved
    take = tuple(slice(max(0, b), n + min(0, b)) for b, n in zip(by, mask.shape, strict=True))
    give = tuple(slice(max(0, -b), n + min(0, -b)) for b, n in zip(by, mask.shape, strict=True))
    moved[give] = mask[take]
    return moved


def _closed(dense: Mask, step: float) -> Mask:
    """Morphological closing by a ball, by distances."""
    pad = int(np.ceil(CLOSING_MM / step)) + 1
    # Bones go on beyond the grid: repeating the last slice keeps the closing from opening them there.
    wide = np.pad(dense, pad, mode="edge")
    grown = sitk.GetImageFromArray(wide.astype(np.uint8))
    grown = sitk.SignedMaurerDistanceMap(grown, squaredDistance=False) <= CLOSING_MM / step
    shrunk = sitk.SignedMaurerDistanceMap(grown, squaredDistance=False) <= -CLOSING_MM / step
    inner = (slice(pad, -pad),) * 3
    return np.asarray((sitk.GetArrayFromImage(shrunk) > 0)[inner] | dense)


def _filled(mask: Mask) -> Mask:
    """Holes closed in space and in slices across each axis: marrow cavities are open at the ends of the scan."""
    image = sitk.GetImageFromArray(mask.astype(np.uint8))
    result = sitk.GetArrayFromImage(sitk.BinaryFillhole(image, True)) > 0
    for axis in range(3):
        result = filled(result, within=axis)
    return result


def _large_pieces(mask: Mask, smallest: float) -> Mask:
    parts, _ = ndimage.label(mask)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    return np.asarray((sizes >= smallest)[parts])
