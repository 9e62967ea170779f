"""Smooth triangle surfaces of labels: the organ with its regions, and the walls around it."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.surfaces.surface import Surface
from palpate.imaging.volume import Volume
from palpate.meshing.extend_labels import crop, extend_labels, without_specks
from palpate.meshing.smooth_distance import SIGMA_MM, SmoothField, smooth_field

# Room around a label, so that cropping does not touch its smoothing.
MARGIN_MM = 14.0


def organ_surfaces(
    labels: Volume, ids: tuple[int, ...] = (1, 2), step_mm: float = 1.0, sigma_mm: float = SIGMA_MM
) -> Surface:
    """The outer surface of the union of organ labels, each face marked by the label it belongs to.

    ``Surface.rim`` gives the points where regions meet. Use the same ``step_mm`` and ``sigma_mm`` for both states,
    so that what little the smoothing moves cancels.

    Raises InputError when none of the labels is there.
    """
    near = organ_near(labels, ids)
    present = [i for i in ids if (near.array == i).any()]
    points, faces = smooth_field(near, near.array > 0, step_mm, sigma_mm).contour()
    return Surface(points, faces, _region_of(points[faces].mean(axis=1), region_fields(near, present, sigma_mm)))


def organ_near(labels: Volume, ids: tuple[int, ...] = (1, 2)) -> Volume:
    """The organ's labels alone, without specks, cropped. Raises InputError when none of them is there."""
    present = [i for i in ids if (labels.array == i).any()]
    if not present:
        raise InputError(f"label volume has no organ voxel (labels {ids}); draw the organ or check the label values")
    union = without_specks(np.isin(labels.array, present), share=0.2)
    return crop(labels.with_array(np.where(union, labels.array, 0)), union, MARGIN_MM)


def wall_surface(labels: Volume, label: int, step_mm: float = 1.2, sigma_mm: float = SIGMA_MM) -> Surface:
    """The surface of one label (4 bone, 5 bladder, 6 rectum), open where it leaves the modelled box.

    The label is first carried on beyond the box, so there is no cap at its end. A label that is absent gives a
    surface without faces.
    """
    near = wall_near(labels, label)
    if not near.array.any():
        return Surface.empty()
    points, faces = smooth_field(near, near.array, step_mm, sigma_mm).contour()
    return Surface(points, faces, np.full(len(faces), label, dtype=np.int64))


def wall_near(labels: Volume, label: int) -> Volume:
    """Mask of one label, carried on beyond the modelled box, without specks, cropped; nothing set where it is absent."""
    mask = without_specks(extend_labels(labels).array == label)
    return crop(labels.with_array(mask), mask, MARGIN_MM) if mask.any() else labels.with_array(mask)


def region_fields(organ: Volume, present: list[int], sigma_mm: float = SIGMA_MM) -> dict[int, SmoothField]:
    """One smooth field per organ label, each blind to what is outside the organ, so they meet on the dividing plane."""
    filled = extend_labels(organ)
    return {i: smooth_field(filled, filled.array == i, 1.0, sigma_mm) for i in present}


def _region_of(points: FloatArray, fields: dict[int, SmoothField]) -> IntArray:
    values = np.stack([field.at(points) for field in fields.values()])
    return np.array(list(fields))[np.argmax(values, axis=0)]
