"""A pair of scans with a known motion between them, from one contoured CT.

The CT is denoised, so that its own noise does not pass for texture that moves along; the second state is the first one
warped by a smooth motion about bladder and rectum, whose contents are others; both get fresh noise of the scan's own size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, Float32Array, FloatArray, LabelArray
from palpate.core.errors import InputError
from palpate.imaging.labels import BLADDER, ORGAN_LABELS, RECTUM
from palpate.imaging.matching.two_scans import LabelledScan
from palpate.imaging.volume import Volume
from palpate.simulate.other_day import (
    CHANGES,
    denoised,
    fresh_noise,
    noise_of,
    other_contents,
    seen_on_another_day,
    thicker_slices,
)
from palpate.validate.segmentation.contoured_scan import ContouredScan

# Half the part of the scan that is matched, mm about the prostate; HU beyond which nothing is told apart.
ROOM_MM, LOW_HU, HIGH_HU = np.array([70.0, 70.0, 72.0]), -300.0, 400.0
# Motion of the neighbourhoods of rectum and bladder: mean, spread and reach, mm.
RECTUM_PUSH, BLADDER_PUSH, PUSH_SD = np.array([0.0, -6.0, 0.0]), np.array([0.0, 2.0, -5.0]), 1.0
RECTUM_REACH, BLADDER_REACH = 22.0, 28.0
# By how much the motion that matching starts from is off, each axis, mm, and over which distance that error changes.
START_SD_MM, START_LENGTH_MM = 1.5, 20.0


@dataclass(frozen=True, eq=False)
class KnownPair:
    """rest, deformed : the two scans and their labels. motion : field mm from rest to deformed, on the grid of the first.

    start : the motion that matching is given. distance : mm to the prostate's surface at rest, negative inside. changes :
    what differs between the two days. noise_hu : standard deviation of the noise at rest.
    """

    rest: LabelledScan
    deformed: LabelledScan
    motion: Volume
    start: Volume
    distance: Volume
    changes: tuple[str, ...]
    noise_hu: float


def known_pair(scan: ContouredScan, seed: int) -> KnownPair:
    """A pair from a scan with contours of prostate, bladder and rectum. Raises InputError where one of them is missing.

    Every second pair has changes between the days besides motion and contents, drawn from the seed.
    """
    random = np.random.default_rng(seed)
    hu, labels, spacing = _cropped(scan)
    noise_hu = noise_of(hu, labels, spacing)
    base = denoised(hu, noise_hu)
    places = np.moveaxis(np.indices(hu.shape), 0, -1) * spacing
    motion = _motion(labels, places, spacing, random)
    rest = _warped(base, places + motion, spacing, 3) + fresh_noise(hu.shape, spacing, noise_hu, random)
    organs = {
        v: _warped((labels == v).astype(np.float32), places + motion, spacing, 1) > 0.5 for v in np.unique(labels)
    }
    rest_labels = np.select(list(organs.values()), list(organs), 0).astype(np.uint8)
    changes = tuple(c for c in CHANGES if random.random() < 0.5) if seed % 2 else ()
    other = seen_on_another_day(other_contents(base, labels, spacing, random), spacing, changes, random)
    factor = 1.5 if "noise" in changes else 1.0
    other = other + fresh_noise(hu.shape, spacing, factor * noise_hu, random)
    grid = np.diag([*spacing, 1.0])
    deformed, drawn = Volume(other, grid), Volume(labels, grid)
    if "slices" in changes:
        deformed = thicker_slices(deformed)
    return KnownPair(
        LabelledScan(Volume(rest, grid), Volume(rest_labels, grid)), LabelledScan(deformed, drawn),
        Volume(motion, grid), Volume(motion + _start_error(hu.shape, spacing, random), grid),
        Volume(_signed(np.isin(rest_labels, ORGAN_LABELS), spacing), grid), changes, noise_hu,
    )  # fmt: skip


def _cropped(scan: ContouredScan) -> tuple[Float32Array, LabelArray, FloatArray]:
    labels = scan.labels.array
    for name, values in (("prostate", ORGAN_LABELS), ("bladder", (BLADDER,)), ("rectum", (RECTUM,))):
        if not np.isin(labels, values).any():
            raise InputError(f"{scan.name} has no contour of the {name}; matching is judged about all three organs")
    spacing = np.asarray(scan.ct.spacing)
    centre = np.argwhere(np.isin(labels, ORGAN_LABELS)).mean(axis=0)
    half = np.rint(ROOM_MM / spacing)
    part = tuple(slice(max(int(c - h), 0), int(c + h) + 1) for c, h in zip(centre, half, strict=True))
    return np.clip(scan.ct.array[part].astype(np.float32), LOW_HU, HIGH_HU), labels[part], spacing


def _motion(labels: LabelArray, places: FloatArray, spacing: FloatArray, random: np.random.Generator) -> FloatArray:
    prostate = (np.argwhere(np.isin(labels, ORGAN_LABELS)) * spacing).mean(axis=0)
    rectum = np.argwhere(labels == RECTUM) * spacing
    beside = rectum[np.abs(rectum[:, 2] - prostate[2]) < 25.0]
    ends = (beside if len(beside) else rectum).mean(axis=0), (np.argwhere(labels == BLADDER) * spacing).mean(axis=0)
    motion = np.zeros_like(places)
    for centre, push, reach in zip(ends, (RECTUM_PUSH, BLADDER_PUSH), (RECTUM_REACH, BLADDER_REACH), strict=True):
        near = np.exp(-((places - centre) ** 2).sum(axis=-1) / (2.0 * reach**2))
        motion += near[..., None] * (push + random.normal(0.0, PUSH_SD, 3))
    return motion


def _start_error(shape: tuple[int, ...], spacing: FloatArray, random: np.random.Generator) -> FloatArray:
    sigma = START_LENGTH_MM / spacing
    error = np.stack([ndimage.gaussian_filter(random.standard_normal(shape), sigma) for _ in range(3)], axis=-1)
    return np.asarray(error * (START_SD_MM / error.std()))


def _warped(image: Float32Array, places: FloatArray, spacing: FloatArray, order: int) -> Float32Array:
    at = (places / spacing).reshape(-1, 3).T
    values = ndimage.map_coordinates(image, at, order=order, mode="nearest")
    return np.asarray(values.reshape(image.shape), dtype=np.float32)


def _signed(inside: BoolArray, spacing: FloatArray) -> FloatArray:
    within = ndimage.distance_transform_edt(inside, sampling=spacing)
    return np.where(inside, -within, ndimage.distance_transform_edt(~inside, sampling=spacing))
