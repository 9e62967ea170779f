"""Left and right half of the prostate, told apart by the plane of the urethra."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, LabelArray
from palpate.core.errors import InputError
from palpate.imaging.labels import PROSTATE_LEFT, PROSTATE_RIGHT
from palpate.imaging.volume import Volume
from palpate.segmentation.bone.landmarks import Pelvis

# A symmetry plane tilted further than this from the patient's axis is a fault of its finding, not of the patient.
STEEPEST = np.cos(np.deg2rad(20.0))


@dataclass(frozen=True, eq=False)
class Plane:
    """point (3,) mm on the plane; unit normal (3,) that points to the patient's left. source : how it was found."""

    point: FloatArray
    normal: FloatArray
    source: str


def midline_normal(pelvis: Pelvis | None) -> tuple[FloatArray, str]:
    """The direction to the patient's left: the normal of the bones' symmetry plane where it may be trusted, else +x."""
    if pelvis is not None and pelvis.reliable and pelvis.normal[0] > STEEPEST:
        return pelvis.normal, "bone symmetry"
    return np.array([1.0, 0.0, 0.0]), "patient axis"


def split_plane(prostate: Volume, normal: FloatArray, source: str, urethra: FloatArray | None = None) -> Plane:
    """The dividing plane: through the urethra where a point (3,) mm on it is known, else through the centroid.

    prostate : mask. normal : to the patient's left. Raises InputError when the mask is empty.
    """
    if not prostate.array.any():
        raise InputError("there is no prostate to divide into left and right; draw it or click on it")
    if urethra is not None:
        return Plane(np.asarray(urethra, dtype=np.float64), normal, f"urethra, {source}")
    centroid = prostate.to_lps(np.argwhere(prostate.array).mean(axis=0)[None])[0]
    return Plane(centroid, normal, f"centroid, {source}")


def halves(prostate: Volume, plane: Plane) -> LabelArray:
    """Label of each voxel of a mask: 1 on the patient's left of the plane, 2 on the right, 0 outside.

    Raises InputError when all of the prostate lies on one side.
    """
    index = np.argwhere(prostate.array)
    side = (prostate.to_lps(index.astype(float)) - plane.point) @ plane.normal
    if (side > 0).all() or (side <= 0).all():
        raise InputError(
            f"the point on the urethra, x = {plane.point[0]:.1f} mm, leaves the whole prostate on one side; correct it"
        )
    result = np.zeros(prostate.array.shape, dtype=np.uint8)
    result[tuple(index.T)] = np.where(side > 0, PROSTATE_LEFT, PROSTATE_RIGHT)
    return result
