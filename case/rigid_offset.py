"""Rigid offset between the two label volumes of a case made by hand, whose scans nobody has aligned on bone.

An offset is assumed where bones and the edge of the labelled region moved alike: the modelled parts of the body have
then not moved against one another, and the model does not depend on the frame. Bones that moved alone are an effect
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

# Largest rms distance of the region's edges in aligned scans, mm; contours and free edges reached 1.0 mm.
_IN_PLACE_MM = 1.2
# Conditions after alignment on bone: largest residual on bone, largest rms distance of the edges, mm, and its largest
# share of the distance before.
_ON_BONE_MM, _NEAR_MM, _SHARE = 1.0, 1.5, 0.5


class OffsetRecord(TypedDict):
    """A `RigidOffset` in mesh.json."""

    deformed_to_rest: list[list[float]]
    shift_mm: float
    turn_deg: float


@dataclass(frozen=True, eq=False)
class RigidOffset:
    """deformed_to_rest : (4, 4), LPS mm, rigid. shift_mm : displacement of the organ's centre. turn_deg : angle of
    rotation.
    """

    deformed_to_rest: FloatArray
    shift_mm: float
    turn_deg: float

    @classmethod
    def from_dict(cls, found: OffsetRecord) -> RigidOffset:
        """Inverse of `to_dict`."""
        return cls(np.array(found["deformed_to_rest"]), float(found["shift_mm"]), float(found["turn_deg"]))

    def back(self, points: FloatArray) -> FloatArray:
        """Points (n, 3), mm, of the deformed scan in the frame of the scan at rest."""
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


def rigid_offset_in(case: CaseFolder, deformed: Volume) -> RigidOffset | None:
    """Rigid offset of a deformed state's labels. None for a case of `import`, which has aligned the scans or was told
    not to.
    """
    if case.has("import.json") or not case.has_labels("rest"):
        return None
    return rigid_offset_between(case.labels("rest"), deformed)


def rigid_offset_between(rest: Volume, deformed: Volume) -> RigidOffset | None:
    """Rigid offset between two label volumes; None where there is none or it cannot be determined."""
    if not ((rest.array == BONE).any() and (deformed.array == BONE).any()):
        return None
    apart = _apart(rest, deformed)
    if apart < _IN_PLACE_MM:
        return None
    try:
        on_bone = align_labels(rest, deformed)
    except InputError:  # bones that cannot be aligned
        return None
    matrix = on_bone.deformed_to_rest
    apart_after = _apart(rest, deformed.moved(matrix))
    if on_bone.residual_mm > _ON_BONE_MM or apart_after > min(_NEAR_MM, _SHARE * apart):
        return None
    organ = deformed.to_lps(np.argwhere(np.isin(deformed.array, ORGAN_LABELS)).astype(np.float64))
    offset = RigidOffset(matrix, 0.0, float(np.rad2deg(Rotation.from_matrix(matrix[:3, :3]).magnitude())))
    return replace(offset, shift_mm=float(np.linalg.norm((offset.back(organ) - organ).mean(axis=0))))


def _apart(rest: Volume, deformed: Volume) -> float:
    """rms distance, mm, between the edges of the labelled regions; 0 where the labels at rest fill their grid and have
    no edge.
    """
    at_rest, after = (SmoothField(v.with_array(signed_distance(v.array > 0, v.spacing))) for v in (rest, deformed))
    edge = np.abs(at_rest.grid.array) < rest.spacing.min()
    if not edge.any():
        return 0.0
    return rms(after.at(rest.to_lps(np.argwhere(edge).astype(np.float64))) - at_rest.grid.array[edge])
