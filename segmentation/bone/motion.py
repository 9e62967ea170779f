"""How each bone lies in the deformed scan against the scan at rest, once both are aligned: whether bones moved as one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from palpate.core.arrays import FloatArray
from palpate.core.statistics import rms
from palpate.imaging.labels import BONE_PART_VALUES
from palpate.segmentation.bone.parts import BoneParts
from palpate.segmentation.methods.surface_mesh import shell_of_mask

SMOOTH_MM, FEWEST, SAMPLES, ROUNDS = 1.5, 300, 3000, 25
# Pairs further apart than the first, and the worst share of the others, have no partner: the scans end elsewhere.
FAR_MM, KEPT = 15.0, 0.85
# A bone that lies further from where it was than this did not move with the others. Voxels of 2 mm leave 0.2 mm.
MOVED_MM = 1.5


@dataclass(frozen=True)
class BoneMotion:
    """How one bone moved against the frame of the scan at rest. moved_mm : rms over its surface; turn_deg; residual_mm
    rms along the normals that no rigid motion explains.
    """

    moved_mm: float
    turn_deg: float
    residual_mm: float

    def to_dict(self) -> dict[str, object]:
        """JSON-able form."""
        return {key: round(value, 3) for key, value in vars(self).items()}


def bone_motions(rest: BoneParts, deformed: BoneParts) -> dict[str, BoneMotion]:
    """Part -> motion, for the parts that both scans (in one frame) show. Point-to-plane alignment of the surfaces."""
    found = {}
    for name, value in BONE_PART_VALUES.items():
        pair = [_surface(parts, value) for parts in (rest, deformed)]
        if all(len(points) >= FEWEST for points, _ in pair):
            found[name] = _motion(pair[0][0], *pair[1])
    return found


def motion_notes(motions: dict[str, BoneMotion]) -> list[str]:
    """One line for each bone that did not move with the others."""
    return [
        f"the {_words(name)} lies {motion.moved_mm:.1f} mm ({motion.turn_deg:.1f} degrees) from where it was at rest: bones "
        "did not move as one, and the model takes them as fixed; look at the alignment"
        for name, motion in motions.items()
        if motion.moved_mm > MOVED_MM and motion.residual_mm < MOVED_MM
    ]


def _words(name: str) -> str:
    """femur_left: left femur."""
    return " ".join(reversed(name.split("_"))) + (" bone" if name.startswith("hip") else "")


def _surface(parts: BoneParts, value: int) -> tuple[FloatArray, FloatArray]:
    """Points (n, 3) mm on a part's surface and outward normals (n, 3); none on the scan's first and last slices."""
    mask = parts.labels.array == value
    if mask.sum() < FEWEST:
        return np.empty((0, 3)), np.empty((0, 3))
    shell = shell_of_mask(mask, parts.labels, SMOOTH_MM)
    z = parts.labels.to_index(shell.points)[:, 2]
    inner = (z > 2.0) & (z < mask.shape[2] - 3.0)
    return shell.points[inner], shell.normals[inner]


def _motion(points: FloatArray, there: FloatArray, normals: FloatArray) -> BoneMotion:
    chosen = points[:: max(1, len(points) // SAMPLES)]
    tree, middle = cKDTree(there), chosen.mean(axis=0)
    moved, turn = chosen, Rotation.identity()
    along = np.zeros(len(chosen))
    for _ in range(ROUNDS):
        far, nearest = tree.query(moved)
        along = np.einsum("ij,ij->i", there[nearest] - moved, normals[nearest])
        # Scans end elsewhere, and joints are not parted alike twice: the worst pairs are left out.
        good = (far < FAR_MM) & (far <= np.quantile(far, KEPT))
        if good.sum() < FEWEST // 2:
            break
        arm = np.cross(moved[good] - middle, normals[nearest][good])
        step = np.linalg.lstsq(np.hstack([arm, normals[nearest][good]]), along[good], rcond=None)[0]
        rotation = Rotation.from_rotvec(step[:3])
        moved = rotation.apply(moved - middle) + middle + step[3:]
        turn, along = rotation * turn, along[good]
        if np.abs(step).max() < 1e-4:
            break
    distance = np.linalg.norm(moved - chosen, axis=1)
    return BoneMotion(rms(distance), float(np.degrees(turn.magnitude())), rms(along))
