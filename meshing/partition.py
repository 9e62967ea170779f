"""What a point is made of: smooth fields of all labels, set against each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.imaging.labels import BLADDER, BONE, LABELS, ORGAN_LABELS, OUTSIDE, RECTUM, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.meshing.extend_labels import crop, extend_labels, padded, without_specks
from palpate.meshing.label_surfaces import MARGIN_MM, region_fields
from palpate.meshing.smooth_distance import CLIP_MM, SmoothField, smooth_field

HOLE_NAMES = {label: LABELS[label] for label in (BONE, BLADDER, RECTUM)}
# Those whose walls move.
HOLLOW_NAMES = {label: LABELS[label] for label in (BLADDER, RECTUM)}
# Grid step of each field in mm: fine where the mesh is fine. -1 stands for the whole organ.
ORGAN = -1
STEP_MM = {ORGAN: 1.0, BLADDER: 1.5, RECTUM: 1.5, BONE: 2.5, OUTSIDE: 3.0}


@dataclass(frozen=True, eq=False)
class Partition:
    """Divides space among organ regions, tissue, holes and outside.

    bodies : smooth field of the whole organ (key ORGAN) and of each hole label present.
    regions : smooth field of each organ region, meaningful inside the organ.
    outside : smooth field of what is not modelled.
    tissue : unsmoothed tissue distance, (grid volume) mm from the nearest tissue voxel.
    """

    bodies: dict[int, SmoothField]
    regions: dict[int, SmoothField]
    outside: SmoothField
    tissue: SmoothField
    tissue_reach_mm: float

    def classify(self, points: FloatArray) -> IntArray:
        """Label (n,) at points (n, 3) mm: 0, 1, 2, 3, 4, 5 or 6."""
        values = np.stack([field.at(points) for field in self.bodies.values()])
        best = values.max(axis=0)
        label = np.array(list(self.bodies))[values.argmax(axis=0)]
        # Far from every body all fields are cut off alike, and the first would win: nothing that is known is there.
        label = np.where(best > -0.99 * CLIP_MM, label, OUTSIDE)
        label = np.where(self._tissue_score(points, best) > best, SURROUNDING_TISSUE, label)
        inside = np.stack([field.at(points) for field in self.regions.values()])
        label = np.where(label == ORGAN, np.array(list(self.regions))[inside.argmax(axis=0)], label)
        return np.asarray(np.where(self.outside.at(points) > 0.0, OUTSIDE, label), dtype=np.int64)

    def against_others(self, body: int) -> SmoothField:
        """The field whose zero is the surface of one body, on that body's grid.

        Where two bodies touch it is half the difference of theirs, so that both get one common surface.
        """
        own = self.bodies[body]
        values = own.grid.array.astype(np.float64)
        near = np.abs(values) < 3.0
        points = own.grid.to_lps(np.argwhere(near).astype(float))
        mine = values[near]
        others = np.full(len(points), -CLIP_MM)
        for key, field in self.bodies.items():
            if key != body:
                np.maximum(others, field.at(points), out=others)
        tissue = self._tissue_score(points, np.maximum(mine, others))
        values[near] = 0.5 * (mine - np.maximum(others, tissue))
        return SmoothField(own.grid.with_array(values))

    def divide(self, first: int, second: int) -> SmoothField:
        """The field whose zero is the surface between two organ regions: positive in the first."""
        a, b = self.regions[first], self.regions[second]
        return SmoothField(a.grid.with_array(0.5 * (a.grid.array - b.grid.array)))

    def _tissue_score(self, points: FloatArray, best: FloatArray) -> FloatArray:
        """What tissue has to set against the best body: its negative, or nothing where no tissue voxel is near.

        Tissue is what the bodies leave, so that a layer one voxel thick is not smoothed away.
        """
        return np.where(self.tissue.at(points) < self.tissue_reach_mm, -best, -np.inf)


def make_partition(labels: Volume) -> Partition:
    """Smooth fields of a label volume. Raises InputError when the labels cannot be meshed."""
    check_labels(labels)
    # Where the labels run to the end of the grid, outside begins there.
    labels = padded(labels, 2, OUTSIDE)
    full = extend_labels(labels)
    bodies = {ORGAN: _field(full, without_specks(np.isin(full.array, ORGAN_LABELS), 0.2), ORGAN)}
    for label in HOLE_NAMES:
        mask = without_specks(full.array == label)
        if mask.any():
            bodies[label] = _field(full, mask, label)
    organ = np.isin(full.array, ORGAN_LABELS)
    near = crop(full.with_array(np.where(organ, full.array, 0)), organ, MARGIN_MM)
    present = [i for i in ORGAN_LABELS if (near.array == i).any()]
    distance = ndimage.distance_transform_edt(full.array != SURROUNDING_TISSUE, sampling=full.spacing)
    return Partition(
        bodies=bodies,
        regions=region_fields(near, present),
        outside=_field(labels, labels.array == OUTSIDE, OUTSIDE),
        tissue=SmoothField(full.with_array(distance.astype(np.float32))),
        tissue_reach_mm=0.6 * float(np.linalg.norm(full.spacing)),
    )


def check_labels(labels: Volume) -> None:
    """Raise InputError, in one line, when a label volume has no organ or no tissue or the organ runs into the edge."""
    organ = np.isin(labels.array, ORGAN_LABELS)
    if not organ.any():
        raise InputError("label volume has no organ voxel (labels 1, 2); draw the organ or check the label values")
    if not (labels.array == SURROUNDING_TISSUE).any():
        raise InputError("label volume has no surrounding tissue (label 3); give the organ at least 10 mm of tissue")
    padded = np.pad(labels.array, 1, constant_values=OUTSIDE)
    beside = ndimage.binary_dilation(np.pad(organ, 1)) & (padded == OUTSIDE)
    if beside.any():
        raise InputError(
            f"the organ touches the edge of the modelled region at {int(beside.sum())} voxels; "
            "label tissue (3) all around it or take a larger volume"
        )


def _field(labels: Volume, mask: BoolArray, key: int) -> SmoothField:
    near = crop(labels.with_array(mask), mask, MARGIN_MM)
    return smooth_field(near, near.array, STEP_MM[key])
