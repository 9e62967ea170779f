"""Rigid alignment of the deformed scan to the scan at rest, on bone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import SimpleITK as sitk
from numpy.typing import NDArray

from palpate.core.errors import InputError
from palpate.segmentation.bone_surface import BoneField, Surface, bone_of_ct, bone_of_labels, bone_surface
from palpate.segmentation.rigid_registration import coarse_shift, matrix_of, reach, register
from palpate.segmentation.volume import Volume

# A surface point with no bone this near has no partner: it is left out of the residual and counted.
PARTNER_WITHIN_MM = 10.0
MIN_OVERLAP = 0.25
DOUBTFUL_MM = 1.5
MAX_UNMATCHED = 0.35
# Noise alone leaves 0.2 to 0.7 mm; above, parts are looked at one by one.
SUSPECT_MM = 0.5
# One part of the bones has moved by itself when a quarter of its surface is this far off, and this many times as far
# as in the middle. A quarter, because a side holds thigh bone and pelvis, and only the thigh moves.
MOVED_MM = 1.0
MOVED_TIMES = 2.5
PARTS = ("right", "centre", "left")
SIDES = ("right", "left")


@dataclass(frozen=True, eq=False)
class Alignment:
    """deformed_to_rest : (4, 4) LPS mm. residual_mm : rms distance of the bone surfaces afterwards, part_residual_mm the
    same for right, centre and left. unmatched : share of the surface without a partner. overlap : share of the bone at
    rest that the deformed scan covers. notes : what a person should know, one line each.
    """

    deformed_to_rest: NDArray[np.float64]
    residual_mm: float
    part_residual_mm: dict[str, float]
    unmatched: float
    overlap: float
    notes: tuple[str, ...] = field(default=())

    def to_dict(self) -> dict[str, Any]:
        """The JSON object of alignment.json."""
        return {
            "deformed_to_rest": self.deformed_to_rest.tolist(),
            "residual_mm": round(self.residual_mm, 4),
            "part_residual_mm": {part: round(value, 4) for part, value in self.part_residual_mm.items()},
            "unmatched": round(self.unmatched, 4),
            "overlap": round(self.overlap, 4),
            "notes": list(self.notes),
        }


def align_ct(rest: Volume, deformed: Volume) -> Alignment:
    """Aligns two CTs (HU) on bone.

    Raises InputError when one shows no bone, they do not overlap or their bones are not the same.
    """
    return _align(bone_of_ct(rest, "the scan at rest"), bone_of_ct(deformed, "the deformed scan"))


def align_labels(rest: Volume, deformed: Volume) -> Alignment:
    """Aligns two label volumes on their bone label. Raises InputError as ``align_ct`` does."""
    return _align(
        bone_of_labels(rest, "the label volume at rest"), bone_of_labels(deformed, "the deformed label volume")
    )


def _align(rest: BoneField, deformed: BoneField) -> Alignment:
    surfaces = bone_surface(rest), bone_surface(deformed)
    start = coarse_shift(rest, deformed)
    mask = reach(rest.mask, 6.0)
    everything = register(rest, deformed, mask, start)
    first, _ = _measured(everything, surfaces, rest, deformed)
    if first.residual_mm < SUSPECT_MM:
        return first
    # A part that moved by itself pulls the whole after it and hides: judge by an alignment on the middle alone, the
    # pelvic ring, and leave out what did not come along.
    _, moved = _measured(
        register(rest, deformed, _without(mask, SIDES, surfaces[0]), everything), surfaces, rest, deformed
    )
    if not moved:
        return first
    again, _ = _measured(
        register(rest, deformed, _without(mask, moved, surfaces[0]), everything), surfaces, rest, deformed
    )
    notes = tuple(
        f"the bones on the {part} did not move with the others ({again.part_residual_mm[part]:.1f} mm rms, the middle "
        f"{again.part_residual_mm['centre']:.1f} mm) and were left out of the alignment: a leg lay differently"
        for part in moved
    )
    return replace(again, notes=notes)


def _measured(
    transform: sitk.Euler3DTransform, surfaces: tuple[Surface, Surface], rest: BoneField, deformed: BoneField
) -> tuple[Alignment, list[str]]:
    """What a transform, rest point to deformed point, achieves, and the parts of the bones that moved by themselves."""
    matrix = np.asarray(np.linalg.inv(matrix_of(transform)), dtype=np.float64)
    points = surfaces[1].points @ matrix[:3, :3].T + matrix[:3, 3]
    points = points[_inside(points, rest.mask)]
    back = np.linalg.inv(matrix)
    overlap = float(_inside(surfaces[0].points @ back[:3, :3].T + back[:3, 3], deformed.mask).mean())
    if overlap < MIN_OVERLAP or len(points) < 100:
        raise InputError(
            f"the two scans have {100 * overlap:.0f} % of the bone in common, {100 * MIN_OVERLAP:.0f} % is needed; "
            "give two scans of the same region of one patient"
        )
    along, far = surfaces[0].distances(points)
    partner = far < PARTNER_WITHIN_MM
    unmatched = float(1.0 - partner.mean())
    if unmatched > MAX_UNMATCHED:
        raise InputError(
            f"after alignment {100 * unmatched:.0f} % of the bone surface has no partner within {PARTNER_WITHIN_MM:.0f} mm; "
            "give two scans of one patient"
        )
    groups = {name: along[partner & (_part_of(points, surfaces[0]) == index)] for index, name in enumerate(PARTS)}
    groups = {name: values for name, values in groups.items() if len(values) > 0.05 * len(points)}
    residuals = {name: _rms(values) for name, values in groups.items()}
    residual = _rms(along[partner])
    notes = (f"the bones agree to {residual:.1f} mm rms only: look at the alignment",) if residual > DOUBTFUL_MM else ()
    found = Alignment(matrix, residual, residuals, unmatched, overlap, notes)
    return found, [name for name in groups if name != "centre" and _moved(groups[name], groups.get("centre"))]


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _moved(side: NDArray[np.float64], centre: NDArray[np.float64] | None) -> bool:
    if centre is None:
        return False
    off, usual = (float(np.percentile(np.abs(values), 75)) for values in (side, centre))
    return off > MOVED_MM and off > MOVED_TIMES * usual


def _limits(surface: Surface) -> NDArray[np.float64]:
    """Where along x the right part ends and the left one begins: the middle half of the bone's width between them."""
    low, high = np.percentile(surface.points[:, 0], [3, 97])
    return np.array([low + 0.25 * (high - low), high - 0.25 * (high - low)])


def _part_of(points: NDArray[np.float64], surface: Surface) -> NDArray[np.intp]:
    """0 right, 1 centre, 2 left, by x (LPS: +x is left)."""
    return np.searchsorted(_limits(surface), points[:, 0])


def _without(mask: sitk.Image, parts: Sequence[str], surface: Surface) -> sitk.Image:
    """The mask less the given sides."""
    volume = Volume.from_sitk(mask)
    inside = volume.array > 0
    kept = ~np.isin(_part_of(volume.to_lps(np.argwhere(inside)), surface), [PARTS.index(part) for part in parts])
    array = volume.array.copy()
    array[inside] = kept
    return volume.with_array(array).to_sitk()


def _inside(points: NDArray[np.float64], image: sitk.Image) -> NDArray[np.bool_]:
    volume = Volume.from_sitk(image)
    index = volume.to_index(points)
    return np.all((index >= 0) & (index <= np.array(volume.array.shape) - 1), axis=1)
