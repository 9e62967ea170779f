"""Figures of every label: volume, CT numbers, stiffness; their histograms, and tables as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray, IntArray
from palpate.imaging.labels import LABELS, ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.labels.label_operations import values_at
from palpate.ui.desktop.session.map_values import map_at
from palpate.ui.report.regions import RegionStiffness

_CUBIC_MM = 1000.0
_BINS = 24


@dataclass(frozen=True)
class MapStatistics:
    """The stiffness map over a label's voxels. told_share : of the voxels whose value the scans tell. median, low, high : G in kPa of
    these, and between which nine in ten of them lie; None where there are none."""

    told_share: float
    median: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class LabelStatistics:
    """volume_cc : of the label's voxels. mean_hu, sd_hu : of the CT in it, None where the scan does not reach. region : its
    stiffness, where it has one. mapped : the stiffness map under it, where there is one."""

    label: int
    volume_cc: float
    mean_hu: float | None
    sd_hu: float | None
    region: RegionStiffness | None
    mapped: MapStatistics | None = None


def label_statistics(
    labels: Volume,
    ct: Volume | None,
    regions: Iterable[RegionStiffness],
    arrays: Mapping[str, NDArray[np.generic]] | None = None,
) -> list[LabelStatistics]:
    """Of each organ that is drawn, in the order of the label values. ct : the scan of the same state. arrays : of the stiffness map."""
    flat, edge = labels.array.reshape(-1), float(np.prod(labels.spacing)) / _CUBIC_MM
    stiff, out = {region.label: region for region in regions}, []
    for label in (value for value in LABELS if value not in (0, SURROUNDING_TISSUE)):
        index = np.flatnonzero(flat == label)
        if not len(index):
            continue
        hu = np.zeros(0) if ct is None else values_at(ct, labels, index)
        hu = hu[np.isfinite(hu)]
        mean, sd = (float(hu.mean()), float(hu.std())) if len(hu) else (None, None)
        mapped = None if arrays is None or label not in ORGAN_LABELS else map_statistics(arrays, labels, index)
        out.append(LabelStatistics(label, len(index) * edge, mean, sd, stiff.get(label), mapped))
    return out


def map_statistics(arrays: Mapping[str, NDArray[np.generic]], labels: Volume, index: IntArray) -> MapStatistics:
    """The map at voxels given by their place in the flat label array."""
    points = labels.to_lps(np.column_stack(np.unravel_index(index, labels.array.shape)).astype(float))
    G, told = map_at(arrays, points, None, labels.array.reshape(-1)[index])
    if not told.any():
        return MapStatistics(0.0, None, None, None)
    low, median, high = (float(value) for value in np.percentile(G[told], (5, 50, 95)))
    return MapStatistics(float(told.mean()), median, low, high)


@dataclass(frozen=True, eq=False)
class Histogram:
    """edges (n + 1,) in `unit`; counts (n,) voxels."""

    quantity: str
    unit: str
    edges: FloatArray
    counts: NDArray[np.int64]


def histograms(
    labels: Volume, label: int, ct: Volume | None, arrays: Mapping[str, NDArray[np.generic]] | None
) -> list[Histogram]:
    """Of a label's voxels: CT numbers where there is a scan, G where a map tells it. arrays : of the stiffness map."""
    index = np.flatnonzero(labels.array.reshape(-1) == label)
    out = []
    if ct is not None and len(index):
        hu = values_at(ct, labels, index)
        out += _histogram("CT", "HU", hu[np.isfinite(hu)])
    if arrays is not None and len(index):
        points = labels.to_lps(np.column_stack(np.unravel_index(index, labels.array.shape)).astype(float))
        G, told = map_at(arrays, points, None)
        out += _histogram("G", "kPa", G[told])
    return out


def as_csv(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table as comma-separated values; what is not known stays empty."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(heads)
    writer.writerows(["" if cell is None else cell for cell in row] for row in rows)
    return out.getvalue()


def _histogram(quantity: str, unit: str, values: FloatArray) -> list[Histogram]:
    if not len(values):
        return []
    counts, edges = np.histogram(values, bins=_BINS)
    return [Histogram(quantity, unit, edges, counts.astype(np.int64))]
