"""Histograms of what lies under a label: CT numbers of the scan, G of the stiffness map; and the tables as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.labels.label_operations import values_at
from palpate.ui.desktop.session.map_values import map_at

_BINS = 24


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
