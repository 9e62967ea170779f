"""A right-angled, evenly spaced volume from slices with uneven gaps or a tilted gantry."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import SimpleITK as sitk

from palpate.core.arrays import FloatArray, NumberArray
from palpate.imaging.dicom.stack import Stack
from palpate.imaging.volume import Volume


def as_volume(pixels: NumberArray, stack: Stack, notes: list[str]) -> Volume:
    """The volume of a stack's pixels (n, rows, columns), resampled only where it must be, which is noted."""
    if not stack.even:
        gaps = np.diff(stack.positions)
        stack = replace(stack, gap=_whole_gap(stack))
        notes.append(
            f"slices lie {gaps.min():.2f} to {gaps.max():.2f} mm apart: interpolated to every {stack.gap:.2f} mm"
        )
        pixels = _evenly(pixels, stack)
    affine = _affine(stack)
    volume = Volume(np.ascontiguousarray(np.transpose(pixels)), affine)
    tilt = math.degrees(math.atan(float(np.linalg.norm(stack.shift))))
    if tilt == 0.0:
        return volume
    notes.append(f"the gantry was tilted by {tilt:.1f} degrees: resampled onto a right-angled grid along the slices")
    return _straightened(volume, stack)


def _whole_gap(stack: Stack) -> float:
    """The gap nearest the usual one, mm, of which the whole length is a multiple: so that the last slice is kept."""
    length = float(stack.positions[-1] - stack.positions[0])
    return length / max(1, round(length / stack.gap))


def _affine(stack: Stack) -> FloatArray:
    first, affine = stack.slices[0], np.eye(4)
    affine[:3, 0] = first.right * first.spacing[0]
    affine[:3, 1] = first.down * first.spacing[1]
    affine[:3, 2] = first.normal * stack.gap
    affine[:3, 3] = first.origin
    return affine


def _evenly(pixels: NumberArray, stack: Stack) -> NumberArray:
    along = stack.positions - stack.positions[0]
    wanted = np.linspace(0.0, along[-1], round(along[-1] / stack.gap) + 1)
    after = np.clip(np.searchsorted(along, wanted), 1, len(along) - 1)
    weight = (wanted - along[after - 1]) / (along[after] - along[after - 1])
    result = np.empty((len(wanted), *pixels.shape[1:]), dtype=np.float32)
    for k, (right, w) in enumerate(zip(after, np.clip(weight, 0.0, 1.0), strict=True)):
        result[k] = (1.0 - w) * pixels[right - 1] + w * pixels[right]
    return _as_type(result, pixels.dtype)


def _straightened(sheared: Volume, stack: Stack) -> Volume:
    """Undoes the in-plane shift from slice to slice. Slices stay where they are, pixels move within them.

    A point y of the patient lies in slice s = n.(y - first) and there, in the grid that pretends to be right-angled, at
    y - s (step - normal): an affine map, which SimpleITK applies.
    """
    first, length = stack.slices[0], stack.gap * (sheared.array.shape[2] - 1)
    shape, origin = list(sheared.array.shape), sheared.affine[:3, 3].copy()
    for axis, direction in enumerate((first.right, first.down)):
        moved = float(stack.shift @ direction) * length / first.spacing[axis]
        shape[axis] += math.ceil(abs(moved))
        origin += min(0, math.floor(moved)) * sheared.affine[:3, axis]
    image = sheared.to_sitk()
    back = sitk.AffineTransform(3)
    back.SetMatrix((np.eye(3) - np.outer(stack.shift, first.normal)).ravel().tolist())
    back.SetCenter([float(x) for x in first.origin])
    air = float(sheared.array.min())
    result = sitk.Resample(
        sitk.Cast(image, sitk.sitkFloat32),
        [int(n) for n in shape],
        back,
        sitk.sitkLinear,
        [float(x) for x in origin],
        image.GetSpacing(),
        image.GetDirection(),
        air,
    )
    straight = Volume.from_sitk(result)
    return straight.with_array(_as_type(straight.array, sheared.array.dtype))


def _as_type(values: NumberArray, dtype: Any) -> NumberArray:
    return np.ascontiguousarray(np.rint(values).astype(np.int16) if dtype == np.int16 else values.astype(np.float32))
