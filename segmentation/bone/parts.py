"""Which bone is which: femurs, hip bones, sacrum and spine, told apart along the joint spaces between them.

Markers that are certainly one bone (the middle of a femoral head, the shaft, what lies medial of the socket, the wings of
the ilium, the midline at the back) grow until they meet, dark and narrow places last (watershed: Beucher and Lantuejoul 1979).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.segmentation import watershed

from palpate.core.arrays import Float32Array, FloatArray, Int32Array, LabelArray
from palpate.imaging.labels import BONE_PART_VALUES
from palpate.imaging.volume import Volume
from palpate.segmentation.bone.femoral_heads import SIDES, Head, find_heads
from palpate.segmentation.bone.landmarks import Pelvis
from palpate.segmentation.bone.lumbosacral_disc import above_sacrum
from palpate.segmentation.working_grid import Mask

# Joint spaces are dark lines narrower than twice this between bright cortices; marrow is wider. HU are cut to this range.
JOINT_MM, LOW_HU, HIGH_HU = 4.0, -50.0, 600.0
# A joint is seen where its space is this much darker than the bone about it.
JOINT_HU = 40.0
# Half the width of the midline that is sacrum, how far behind the heads; and how far from the midline ilium begins, mm.
MIDLINE_MM, BEHIND_MM, WING_MM = 22.0, 25.0, 62.0
# As shares of the head's radius: the certain core, how far lateral the trochanter is, how far medial the socket is.
CORE, LATERAL, MEDIAL = 0.85, 1.1, 0.6
# The cortex and cartilage about a head, and how far above its upper pole the hip bone is certain, mm.
SOCKET_MM, ROOF_MM, RIM_MM = 6.0, 8.0, 15.0
SMALLEST_CC = 0.5
# Bones further below and above the symphysis than this, mm, are not looked at: scans of the whole body are large.
BELOW_MM, ABOVE_MM = 200.0, 250.0


@dataclass(frozen=True, eq=False)
class BoneParts:
    """labels : values of BONE_PART_VALUES on the grid of the bone mask, 0 elsewhere. confidence : name -> 0 to 1. heads :
    the femoral heads that the scan shows, by side.
    """

    labels: Volume
    confidence: dict[str, float]
    heads: dict[str, Head] = field(default_factory=dict)

    def volume_cc(self, name: str) -> float:
        """Volume of a part within the scan, cc."""
        return float((self.labels.array == BONE_PART_VALUES[name]).sum() * np.prod(self.labels.spacing)) / 1000.0

    def on(self, grid: Volume, bone: Mask) -> LabelArray:
        """The part nearest to each voxel of a bone mask on another grid; 0 elsewhere and where no part was found."""
        result = np.zeros(grid.array.shape, dtype=np.uint8)
        if not self.labels.array.any() or not bone.any():
            return result
        known = ndimage.find_objects((self.labels.array > 0).astype(np.uint8))[0]
        near = self.labels.array[known]
        nearest = ndimage.distance_transform_edt(
            near == 0, sampling=self.labels.spacing, return_distances=False, return_indices=True
        )
        index = self.labels.to_index(grid.to_lps(np.argwhere(bone).astype(float))) - [part.start for part in known]
        at = np.clip(np.rint(index).astype(int), 0, np.array(near.shape) - 1).T
        result[bone] = near[tuple(nearest[(slice(None), *at)])]
        return result


def bone_parts(hu: Volume, bone: Volume, pelvis: Pelvis) -> BoneParts:
    """The parts of a bone mask. hu : of the same even upright grid of about 2 mm."""
    heads = find_heads(hu, pelvis)
    labels = np.zeros(bone.array.shape, dtype=np.uint8)
    bone = bone.with_array(bone.array & _about(bone, pelvis))
    used = ndimage.find_objects(bone.array.astype(np.uint8))
    if not used or not heads:
        return BoneParts(bone.with_array(labels), {}, heads)
    part = used[0]
    relief = _joints(hu.array[part], float(hu.spacing[0]))
    markers = np.zeros(bone.array.shape, dtype=np.int32)
    index = np.argwhere(bone.array)
    points = bone.to_lps(index.astype(float))
    markers[tuple(index.T)] = _markers(points, heads, pelvis)
    labels[part] = watershed(relief, markers[part], mask=bone.array[part])
    labels = _whole(labels, float(np.prod(bone.spacing)) / 1000.0)
    confidence = _confidence(labels[part], relief, heads)
    upper = above_sacrum(hu, bone.with_array(labels), pelvis)
    labels[upper] = BONE_PART_VALUES["spine"]
    if upper.any():
        confidence["spine"] = confidence["sacrum"]
    return BoneParts(bone.with_array(labels), confidence, heads)


def _about(bone: Volume, pelvis: Pelvis) -> Mask:
    """Slices (1, 1, k) of the grid near the pelvis."""
    z = bone.affine[2, 3] + bone.spacing[2] * np.arange(bone.array.shape[2])
    low, high = pelvis.symphysis[0, 2] - BELOW_MM, pelvis.symphysis[1, 2] + ABOVE_MM
    return np.asarray((z > low) & (z < high))[None, None, :]


def _joints(hu: NDArray[np.floating], step: float) -> Float32Array:
    """How much darker (HU) than what closes over it each voxel is: high in joint spaces, low in cortex and wide marrow."""
    smooth = ndimage.gaussian_filter(np.clip(hu, LOW_HU, HIGH_HU).astype(np.float32), 0.6)
    reach = round(JOINT_MM / step)
    offsets = np.indices((2 * reach + 1,) * 3) - reach
    ball = (offsets**2).sum(axis=0) <= reach**2
    return np.asarray(ndimage.grey_closing(smooth, footprint=ball) - smooth)


def _markers(points: FloatArray, heads: dict[str, Head], pelvis: Pelvis) -> Int32Array:
    """For bone voxels (n, 3) mm the part that they certainly are (n,), 0 where it is not certain."""
    found = np.zeros(len(points), dtype=np.int32)
    off = (points - pelvis.point) @ pelvis.normal
    centre = np.mean([head.centre for head in heads.values()], axis=0)
    radius = max(head.radius_mm for head in heads.values())
    behind = (points[:, 1] > centre[1] + BEHIND_MM) | (points[:, 2] > centre[2] + radius + BEHIND_MM)
    found[(np.abs(off) < MIDLINE_MM) & behind] = BONE_PART_VALUES["sacrum"]
    for side, sign in SIDES.items():
        hip, above = BONE_PART_VALUES[f"hip_{side}"], points[:, 2] - centre[2] - radius
        found[(sign * off > WING_MM) & (above > ROOF_MM)] = hip
        front = (points[:, 1] < centre[1] + BEHIND_MM) & (above < RIM_MM) & (sign * off > 4.0)
        if side not in heads:
            found[front] = hip
            continue
        head = heads[side]
        lateral = sign * (points[:, 0] - head.centre[0])
        far = np.linalg.norm(points - head.centre, axis=1)
        found[front & (lateral < -MEDIAL * head.radius_mm) & (far > head.radius_mm + SOCKET_MM)] = hip
        shaft = (lateral > LATERAL * head.radius_mm) & (points[:, 2] < head.centre[2] + 0.3 * head.radius_mm)
        found[shaft | (far < CORE * head.radius_mm)] = BONE_PART_VALUES[f"femur_{side}"]
    return found


def _whole(labels: LabelArray, voxel_cc: float) -> LabelArray:
    """Femurs and hip bones in one piece each: what is loose is rib, arm or calcification. The coccyx may be loose."""
    for name, value in BONE_PART_VALUES.items():
        parts, count = ndimage.label(labels == value)
        if count < 2:
            continue
        sizes = np.bincount(parts.ravel())
        sizes[0] = 0
        keep = sizes >= (SMALLEST_CC / voxel_cc if name == "sacrum" else sizes.max())
        labels[(parts > 0) & ~keep[parts]] = 0
    return labels


def _confidence(labels: LabelArray, relief: Float32Array, heads: dict[str, Head]) -> dict[str, float]:
    """From the share of each part's border with others at which a joint space is seen, and of the head for femurs."""
    touching = np.zeros(labels.shape, dtype=bool)
    for axis in range(3):
        before, after = [slice(None)] * 3, [slice(None)] * 3
        before[axis], after[axis] = slice(None, -1), slice(1, None)
        a, b = labels[tuple(before)], labels[tuple(after)]
        meets = (a != b) & (a > 0) & (b > 0)
        touching[tuple(before)] |= meets
        touching[tuple(after)] |= meets
    shown = ndimage.maximum_filter(relief, 3) > JOINT_HU
    found = {}
    for name, value in BONE_PART_VALUES.items():
        here = labels == value
        if not here.any():
            continue
        border = here & touching
        joint = float(shown[border].mean()) if border.any() else 1.0
        side = name.removeprefix("femur_")
        found[name] = round(joint * (min(1.0, heads[side].seen / 0.8) if side in heads else 1.0), 3)
    return found
