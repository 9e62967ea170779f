"""A deformed scan that lies elsewhere as a whole: case folders made by hand, whose scans nobody has aligned on bone.

Where the bones moved and the edge of the drawn region with them, no part of the body that a model holds has moved against another: the
same model, which does not care where a patient lies, seen from another frame. Where bones moved alone, something did move
(`core.diagnose.effects.bone_motion`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.case.case_folder import CaseFolder
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.statistics import rms
from palpate.core.surfaces.rigid_motion import transformed
from palpate.imaging.labels import BONE, ORGAN_LABELS
from palpate.imaging.registration.align_on_bone import align_labels
from palpate.imaging.volume import Volume
from palpate.meshing.smooth_distance import SmoothField, signed_distance

# The region's edge may lie as far apart as this, rms mm, in scans that are aligned; contours and free edges do (1.0 mm were seen).
_IN_PLACE_MM = 1.2
# Once the bones are laid on one another, to _ON_BONE_MM, its edge must be this near, rms mm, and so much nearer than before.
_ON_BONE_MM, _NEAR_MM, _SHARE = 1.0, 1.5, 0.5


class OffsetRecord(TypedDict):
    """A `RigidOffset` in mesh.json."""

    deformed_to_rest: list[list[float]]
    shift_mm: float
    turn_deg: float


@dataclass(frozen=True, eq=False)
class RigidOffset:
    """deformed_to_rest : (4, 4) LPS mm, rigid. shift_mm : how far it takes the organ's middle; turn_deg : by how much it turns."""

    deformed_to_rest: FloatArray
    shift_mm: float
    turn_deg: float

    @classmethod
    def from_dict(cls, found: OffsetRecord) -> RigidOffset:
        """Of what `to_dict` made."""
        return cls(np.array(found["deformed_to_rest"]), float(found["shift_mm"]), float(found["turn_deg"]))

    def back(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) mm of the deformed scan in the frame of the one at rest."""
        return transformed(self.deformed_to_rest, points)

    def to_dict(self) -> OffsetRecord:
        """The JSON object in mesh.json."""
        return {
            "deformed_to_rest": self.deformed_to_rest.tolist(),
            "shift_mm": round(self.shift_mm, 3),
            "turn_deg": round(self.turn_deg, 3),
        }

    def words(self, scan: str = "the deformed scan") -> str:
        """For a person, in one line."""
        return (
            f"{scan} lay {self.shift_mm:.1f} mm and {self.turn_deg:.1f} degrees from the one at rest, bones and the region's "
            "edge alike, and was laid on its bones first; `palpate import` of both label volumes aligns them for good"
        )


def elsewhere_in(case: CaseFolder, deformed: Volume) -> RigidOffset | None:
    """How a deformed state of a case lies elsewhere. None where `import` made the case: it aligns scans, or was told not to."""
    if case.has("import.json") or not case.has_labels("rest"):
        return None
    return laid_elsewhere(case.labels("rest"), deformed)


def laid_elsewhere(rest: Volume, deformed: Volume) -> RigidOffset | None:
    """How two label volumes lie apart as a whole; None where they do not, or where that cannot be told."""
    if not ((rest.array == BONE).any() and (deformed.array == BONE).any()):
        return None
    apart = _apart(rest, deformed)
    if apart < _IN_PLACE_MM:
        return None
    try:
        on_bone = align_labels(rest, deformed)
    except InputError:  # bones that cannot be laid on one another
        return None
    matrix = on_bone.deformed_to_rest
    left = _apart(rest, deformed.moved(matrix))
    if on_bone.residual_mm > _ON_BONE_MM or left > min(_NEAR_MM, _SHARE * apart):
        return None
    organ = deformed.to_lps(np.argwhere(np.isin(deformed.array, ORGAN_LABELS)).astype(np.float64))
    found = RigidOffset(matrix, 0.0, float(np.rad2deg(Rotation.from_matrix(matrix[:3, :3]).magnitude())))
    return replace(found, shift_mm=float(np.linalg.norm((found.back(organ) - organ).mean(axis=0))))


def _apart(rest: Volume, deformed: Volume) -> float:
    """rms mm between the edges of everything that has a label; 0 where the labels at rest fill their grid and have none."""
    here, there = (SmoothField(v.with_array(signed_distance(v.array > 0, v.spacing))) for v in (rest, deformed))
    edge = np.abs(here.grid.array) < rest.spacing.min()
    if not edge.any():
        return 0.0
    off = there.at(rest.to_lps(np.argwhere(edge).astype(np.float64))) - here.grid.array[edge]
    return rms(off)
