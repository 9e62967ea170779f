"""Parts of an organ that lie apart from the rest of it: meshes are made of one piece."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from palpate.imaging.labels import BLADDER, ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume

_ORGANS = {"prostate": ORGAN_LABELS, "bladder": (BLADDER,), "rectum": (RECTUM,)}


def detached_notes(labels: Volume) -> list[str]:
    """One note on each organ of a label volume that is in several pieces (26 neighbours), with the size of what lies apart."""
    notes = []
    voxel_cc = float(np.abs(np.linalg.det(labels.affine[:3, :3]))) / 1000.0
    for organ, values in _ORGANS.items():
        mask = np.isin(labels.array, values)
        box = ndimage.find_objects(mask.astype(np.uint8))
        parts, count = ndimage.label(mask[box[0]], structure=np.ones((3, 3, 3))) if box else (mask, 0)
        if count < 2:
            continue
        sizes = np.sort(np.bincount(parts.ravel())[1:])[::-1]
        apart = int(sizes[1:].sum())
        what = "a part" if count == 2 else f"{count - 1} parts"
        notes.append(
            f"{organ}: {what} of {apart} voxels ({apart * voxel_cc:.2g} cc) detached from the rest; a mesh is made of the largest part only"
        )
    return notes
