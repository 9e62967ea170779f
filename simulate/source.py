"""What a simulation starts from: the phantom, or a case with its contours and perhaps its CT."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from palpate.core.arrays import Float32Array, FloatArray, LabelArray
from palpate.core.errors import InputError
from palpate.imaging.labels import OUTSIDE
from palpate.imaging.volume import Volume
from palpate.meshing.partition import Partition, make_partition
from palpate.simulate.phantom import phantom
from palpate.simulate.scanner import Scanner
from palpate.simulate.second_scan import SecondScan, with_noise_anew

# Rest positions (n, 3) mm of points (n, 3) mm in the scanner's coordinates.
ToRest = Callable[[FloatArray], FloatArray]


class Source(Protocol):
    """A body at rest, in the rest scan's coordinates."""

    @property
    def name(self) -> str:
        """The case's name."""

    @property
    def body(self) -> Volume:
        """Labels to be meshed, 0 outside the modelled region; the same in each pair of one body."""

    @property
    def model_labels(self) -> Volume:
        """Labels whose smooth surfaces are the contours, 0 outside the modelled region."""

    @property
    def label_grid(self) -> Volume:
        """Grid on which labels are written."""

    def labels(self, points: FloatArray) -> LabelArray:
        """Label (n,) of points (n, 3) mm."""

    def scan(self, to_rest: ToRest | None, grid: Volume | None, seed: int) -> Volume:
        """CT (int16) of the body moved so that y shows what ``to_rest`` (None: nothing moved) says; grid None: the own one."""


@dataclass(frozen=True)
class RoundedBox:
    """A superellipsoid: semi_axes_mm about centre_mm, which is about the prostate's centroid."""

    semi_axes_mm: tuple[float, float, float]
    centre_mm: tuple[float, float, float]
    power: float


# What a case of labels holds: its edge is the body's end for the simulation and for who analyses the labels.
LABELLED = RoundedBox((58.0, 64.0, 67.0), (0.0, 8.0, 15.0), 4.0)
# What moves where scans are made: all that an analysis crops from them, and some 10 mm more, so that the edge at which the
# body is held is not the one that the analysis holds. A body that is rigid inside that edge is like no patient.
SCANNED = RoundedBox((75.0, 84.0, 80.0), (0.0, 4.0, 8.0), 8.0)


@dataclass(frozen=True)
class PhantomSource:
    """The analytic pelvis.

    voxel_mm : of its CT and labels. low_mm, high_mm : the CT's field of view about the anatomy's zero. region :
    what of it is modelled; held still at its edge.
    """

    voxel_mm: tuple[float, float, float] = (1.2, 1.2, 2.0)
    low_mm: tuple[float, float, float] = (-174.0, -101.0, -60.0)
    high_mm: tuple[float, float, float] = (177.0, 128.0, 74.0)
    region: RoundedBox = LABELLED
    model_voxel_mm: float = 1.25
    scanner: Scanner = field(default_factory=Scanner)
    name: str = "phantom"

    @property
    def ct_grid(self) -> Volume:
        """Grid of the CT at rest."""
        return _grid(np.add(self.low_mm, phantom.ORIGIN_MM), np.add(self.high_mm, phantom.ORIGIN_MM), self.voxel_mm)

    @property
    def label_grid(self) -> Volume:
        """See `Source.label_grid`."""
        return self._region_grid(self.voxel_mm)

    @property
    def body(self) -> Volume:
        """See `Source.body`."""
        return self.model_labels

    @property
    def model_labels(self) -> Volume:
        """See `Source.model_labels`."""
        return labels_on(self.labels, self._region_grid((self.model_voxel_mm,) * 3))

    def labels(self, points: FloatArray) -> LabelArray:
        """See `Source.labels`."""
        reach = (np.abs(points - self._centre) / np.array(self.region.semi_axes_mm)) ** self.region.power
        return np.where(reach.sum(axis=1) < 1.0, phantom.labels(points), OUTSIDE).astype(np.uint8)

    def scan(self, to_rest: ToRest | None, grid: Volume | None, seed: int) -> Volume:
        """See `Source.scan`."""
        body = phantom.hu if to_rest is None else lambda points: phantom.hu(to_rest(points))
        return self.scanner.scan(body, grid or self.ct_grid, seed)

    @property
    def _centre(self) -> FloatArray:
        return np.add(phantom.prostate_centroid(), self.region.centre_mm)

    def _region_grid(self, voxel_mm: tuple[float, float, float]) -> Volume:
        """Voxels about the region; the plane between the halves lies midway between centres, so that none lies on it."""
        reach = np.array(self.region.semi_axes_mm) + 2.0 * np.array(voxel_mm)
        low, split = self._centre - reach, phantom.prostate_centroid()[0]
        low[0] = split - (np.ceil((split - low[0]) / voxel_mm[0] - 0.5) + 0.5) * voxel_mm[0]
        return _grid(low, self._centre + reach, voxel_mm)


@dataclass(frozen=True, eq=False)
class VolumeSource:
    """A real body: labels of the state at rest and its CT (None: labels can be simulated, scans cannot).

    changes : what else differs on the day of the second scan, of `other_day.CHANGES`. noise_anew : the scan at rest has
    fresh noise in place of its own. drawn : the labels as they were drawn, where those of `model_labels` lie on another grid.
    """

    name: str
    model_labels: Volume
    ct: Volume | None
    changes: tuple[str, ...] = ()
    noise_anew: bool = False
    drawn: Volume | None = None

    @property
    def body(self) -> Volume:
        """See `Source.body`."""
        return self.drawn or self.model_labels

    @property
    def label_grid(self) -> Volume:
        """See `Source.label_grid`."""
        return self.body

    def on_voxels_of_its_own(self, random: np.random.Generator) -> VolumeSource:
        """The same body from labels on a grid that lies a random share of a voxel elsewhere; written where it was drawn.

        A smooth surface of labels keeps faint steps of their voxels. Voxelised on the same grid it shows all of these
        again, on another, as in the second scan, hardly any: a false motion, the same in each pair of one body.
        """
        grid = self.model_labels
        affine = grid.affine.copy()
        affine[:3, 3] = grid.to_lps(random.uniform(-0.5, 0.5, (1, 3)))[0]
        moved = labels_on(self.labels, Volume(grid.array, affine))
        return replace(self, model_labels=moved, drawn=grid)

    def labels(self, points: FloatArray) -> LabelArray:
        """See `Source.labels`: from the contours' smooth surfaces, so that a moved contour has no voxel steps."""
        return self._partition.classify(points).astype(np.uint8)

    def scan(self, to_rest: ToRest | None, grid: Volume | None, seed: int) -> Volume:
        """See `Source.scan`: the given CT, or that CT without noise where its tissue was at rest (`SecondScan`)."""
        ct, random = self._needed_ct(), np.random.default_rng(seed)
        own = to_rest is None and grid is None
        if own and not self.noise_anew:
            return ct
        if own:
            return _as_stored(with_noise_anew(ct, self.body, random), ct, ct)
        scan = SecondScan.of(ct, self.body, self._labels_on, random)
        moved = scan.seen(to_rest or (lambda points: points), grid or ct, self.changes, random)
        return _as_stored(moved, ct, grid or ct)

    def _labels_on(self, grid: Volume) -> Volume:
        return labels_on(self.labels, grid)

    def _needed_ct(self) -> Volume:
        if self.ct is None:
            raise InputError("simulation spec: output is 'dicom' but the source has no CT; set output to 'labels'")
        return self.ct

    @cached_property
    def _partition(self) -> Partition:
        return make_partition(self.model_labels)


def labels_on(labels: Callable[[FloatArray], LabelArray], grid: Volume) -> Volume:
    """Labels (uint8) at the voxel centres of a grid."""
    shape = grid.array.shape
    result = np.empty(shape, dtype=np.uint8)
    plane = np.stack(np.meshgrid(np.arange(shape[0]), np.arange(shape[1]), indexing="ij"), axis=-1).reshape(-1, 2)
    for k in range(shape[2]):
        index = np.column_stack([plane, np.full(len(plane), k)]).astype(np.float64)
        result[:, :, k] = labels(grid.to_lps(index)).reshape(shape[:2])
    return grid.with_array(result)


def _as_stored(hu: Float32Array, ct: Volume, grid: Volume) -> Volume:
    """HU on a grid as a CT's files hold them: whole numbers within that CT's own."""
    return grid.with_array(np.rint(np.clip(hu, int(ct.array.min()), int(ct.array.max()))).astype(np.int16))


def _grid(low: FloatArray, high: FloatArray, voxel_mm: tuple[float, float, float]) -> Volume:
    spacing = np.array(voxel_mm)
    return Volume.upright(np.asarray(low), spacing, np.ceil((np.asarray(high) - low) / spacing - 1e-9))
