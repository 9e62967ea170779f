"""Rigid alignment of the deformed scan to the scan at rest, on bone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import SimpleITK as sitk
from numpy.typing import NDArray

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.core.statistics import rms
from palpate.core.surfaces.rigid_motion import transformed
from palpate.imaging.dicom.hounsfield import soft_tissue_note
from palpate.imaging.registration.bone_surface import (
    BoneField,
    OrientedPoints,
    bone_of_ct,
    bone_of_labels,
    bone_surface,
)
from palpate.imaging.registration.rigid import coarse_shift, matrix_of, reach, register
from palpate.imaging.volume import Volume

# A surface point with no bone this near has no partner: it is left out of the residual and counted.
PARTNER_WITHIN_MM = 10.0
MIN_OVERLAP = 0.25
DOUBTFUL_MM = 1.5
# Measured: 0.2 to 0.7 mm for one patient, 3.6 mm for two.
MAX_RESIDUAL_MM = 2.5
MAX_UNMATCHED = 0.35
# Noise alone leaves 0.2 to 0.7 mm; above, parts are looked at one by one.
SUSPECT_MM = 0.5
# One part of the bones has moved by itself when a quarter of its surface is this far off, and this many times as far
# as in the middle. A quarter, because a side holds thigh bone and pelvis, and only the thigh moves.
MOVED_MM = 1.0
MOVED_TIMES = 2.5
PARTS = ("right", "centre", "left")
# Of the surface; smaller parts say nothing.
SMALLEST_PART = 0.05
SIDES = ("right", "left")


@dataclass(frozen=True, eq=False)
class Alignment:
    """deformed_to_rest : (4, 4) LPS mm. residual_mm : rms distance of the bone surfaces afterwards, part_residual_mm the
    same for right, centre and left. unmatched : share of the surface without a partner. overlap : share of the bone at
    rest that the deformed scan covers. notes : what a person should know, one line each.
    """

    deformed_to_rest: FloatArray
    residual_mm: float
    part_residual_mm: dict[str, float]
    unmatched: float
    overlap: float
    notes: tuple[str, ...] = field(default=())

    def to_dict(self) -> dict[str, object]:
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
    return _align(
        bone_of_ct(rest, "the scan at rest"), bone_of_ct(deformed, "the deformed scan"), _hu_off(rest, deformed)
    )


def _hu_off(rest: Volume, deformed: Volume) -> bool:
    """Whether soft tissue, and bone with it, lies at other HU in one of two CTs than it should."""
    return bool(soft_tissue_note(rest) or soft_tissue_note(deformed))


def align_labels(rest: Volume, deformed: Volume) -> Alignment:
    """Aligns two label volumes on their bone label. Raises InputError as ``align_ct`` does."""
    return _align(
        bone_of_labels(rest, "the label volume at rest"), bone_of_labels(deformed, "the deformed label volume")
    )


def given_alignment(rest: Volume, deformed: Volume, deformed_to_rest: FloatArray, source: Path) -> Alignment:
    """An alignment of two CTs (HU) from elsewhere, (4, 4) LPS mm, measured on bone. source : its file.

    Raises InputError when the scans show no common bone, or their bones lie apart under it: the model's frame is that of the bones.
    """
    bones = bone_of_ct(rest, "the scan at rest"), bone_of_ct(deformed, "the deformed scan")
    surfaces = bone_surface(bones[0]), bone_surface(bones[1])
    found, _ = _measured(np.asarray(np.linalg.inv(deformed_to_rest)), surfaces, *bones)
    try:
        found = _accepted(found, _hu_off(rest, deformed))
    except InputError as error:
        why = str(error).rpartition(";")[0]
        raise InputError(f"{source}: {why}; leave it out to align on bone") from error
    return replace(found, notes=(*found.notes, "aligned by the registration that was given, not on bone"))


def _align(rest: BoneField, deformed: BoneField, hu_off: bool = False) -> Alignment:
    """hu_off : whether bone lies at other values in the two, so that its surfaces differ where the scans do not."""
    surfaces = bone_surface(rest), bone_surface(deformed)
    start = coarse_shift(rest, deformed)
    mask = reach(rest.mask, 6.0)
    everything = register(rest, deformed, mask, start)
    first, _ = _measured(matrix_of(everything), surfaces, rest, deformed)
    if first.residual_mm < SUSPECT_MM:
        return _accepted(first, hu_off)
    # A part that moved by itself pulls the whole after it and hides: judge by an alignment on the middle alone, the
    # pelvic ring, and leave out what did not come along.
    inner = register(rest, deformed, _without(mask, SIDES, surfaces[0]), everything)
    _, off = _measured(matrix_of(inner), surfaces, rest, deformed)
    moved = [part for part in SIDES if off[part] > max(MOVED_MM, MOVED_TIMES * off["centre"])]
    if not moved:
        return _accepted(first, hu_off)
    transform = register(rest, deformed, _without(mask, moved, surfaces[0]), everything)
    found, off = _measured(matrix_of(transform), surfaces, rest, deformed)
    notes = tuple(
        f"the bones on the {part} did not move with the others (a quarter is {off[part]:.1f} mm off or more, in the middle "
        f"{off['centre']:.1f} mm) and were left out of the alignment: a leg lay differently"
        for part in moved
    )
    return _accepted(replace(found, notes=notes), hu_off)


def _measured(
    back: FloatArray,
    surfaces: tuple[OrientedPoints, OrientedPoints],
    rest: BoneField,
    deformed: BoneField,
) -> tuple[Alignment, dict[str, float]]:
    """What a transform (4, 4), rest point to deformed point, achieves; and for each part how far off a quarter of it is, mm."""
    matrix = np.asarray(np.linalg.inv(back), dtype=np.float64)
    overlap = float(_inside(transformed(back, surfaces[0].points), deformed.mask).mean())
    points = transformed(matrix, surfaces[1].points)
    points = points[_inside(points, rest.mask)]
    if len(points) < 100:
        raise InputError("the two scans show no common bone; give two scans of the same region of one patient")
    along, far = surfaces[0].distances(points)
    partner, parts = far < PARTNER_WITHIN_MM, _part_of(points, surfaces[0])
    away = np.where(partner, np.abs(along), PARTNER_WITHIN_MM)
    residuals, off = {}, dict.fromkeys(PARTS, 0.0)
    for index, name in enumerate(PARTS):
        if (parts == index).mean() > SMALLEST_PART:
            off[name] = float(np.percentile(away[parts == index], 75))
            residuals[name] = _rms(along[partner & (parts == index)])
    return Alignment(matrix, _rms(along[partner]), residuals, float(1.0 - partner.mean()), overlap), off


def _accepted(found: Alignment, hu_off: bool) -> Alignment:
    """The alignment, with a note where it is doubtful. Raises InputError when it cannot be two scans of one pelvis.

    hu_off : bones that lie apart say nothing of the alignment; what they are told of is the HU (`soft_tissue_note`).
    """
    if found.overlap < MIN_OVERLAP:
        raise InputError(
            f"the two scans have {100 * found.overlap:.0f} % of the bone in common, {100 * MIN_OVERLAP:.0f} % is needed; "
            "give two scans of the same region of one patient"
        )
    middle = found.part_residual_mm.get("centre", found.residual_mm)
    if found.unmatched > MAX_UNMATCHED or middle > MAX_RESIDUAL_MM:
        raise InputError(
            f"after alignment the bones lie {middle:.1f} mm rms apart (up to {MAX_RESIDUAL_MM:g} mm is one patient's) and "
            f"{100 * found.unmatched:.0f} % has no partner within {PARTNER_WITHIN_MM:.0f} mm; "
            + (
                "the HU of a scan, by which bone is found, are off: calibrate it"
                if hu_off
                else "give two scans of one patient"
            )
        )
    if middle > DOUBTFUL_MM and not hu_off:
        return replace(
            found, notes=(*found.notes, f"the bones agree to {middle:.1f} mm rms only: look at the alignment")
        )
    return found


def _rms(values: FloatArray) -> float:
    return rms(values) if len(values) else float(PARTNER_WITHIN_MM)


def _limits(surface: OrientedPoints) -> FloatArray:
    """Where along x the right part ends and the left one begins: the middle half of the bone's width between them."""
    low, high = np.percentile(surface.points[:, 0], [3, 97])
    return np.array([low + 0.25 * (high - low), high - 0.25 * (high - low)])


def _part_of(points: FloatArray, surface: OrientedPoints) -> NDArray[np.intp]:
    """0 right, 1 centre, 2 left, by x (LPS: +x is left)."""
    return np.searchsorted(_limits(surface), points[:, 0])


def _without(mask: sitk.Image, parts: Sequence[str], surface: OrientedPoints) -> sitk.Image:
    """The mask less the given sides."""
    volume = Volume.from_sitk(mask)
    inside = volume.array > 0
    kept = ~np.isin(
        _part_of(volume.to_lps(np.argwhere(inside).astype(np.float64)), surface), [PARTS.index(part) for part in parts]
    )
    array = volume.array.copy()
    array[inside] = kept
    return volume.with_array(array).to_sitk()


def _inside(points: FloatArray, image: sitk.Image) -> BoolArray:
    volume = Volume.from_sitk(image)
    index = volume.to_index(points)
    return np.all((index >= 0) & (index <= np.array(volume.array.shape) - 1), axis=1)
