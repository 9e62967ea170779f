"""Figures of every label: volume, CT numbers, stiffness."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from palpate.imaging.labels import LABELS, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.label_operations import values_at
from palpate.ui.report.regions import RegionStiffness

_CUBIC_MM = 1000.0


@dataclass(frozen=True)
class LabelStatistics:
    """volume_cc : of the label's voxels. mean_hu, sd_hu : of the CT in it, None where the scan does not reach. region : its
    stiffness, where it has one."""

    label: int
    volume_cc: float
    mean_hu: float | None
    sd_hu: float | None
    region: RegionStiffness | None


def label_statistics(labels: Volume, ct: Volume | None, regions: Iterable[RegionStiffness]) -> list[LabelStatistics]:
    """Of each organ that is drawn, in the order of the label values. ct : the scan of the same state."""
    flat, edge = labels.array.reshape(-1), float(np.prod(labels.spacing)) / _CUBIC_MM
    stiff, out = {region.label: region for region in regions}, []
    for label in (value for value in LABELS if value not in (0, SURROUNDING_TISSUE)):
        index = np.flatnonzero(flat == label)
        if not len(index):
            continue
        hu = np.zeros(0) if ct is None else values_at(ct, labels, index)
        hu = hu[np.isfinite(hu)]
        mean, sd = (float(hu.mean()), float(hu.std())) if len(hu) else (None, None)
        out.append(LabelStatistics(label, len(index) * edge, mean, sd, stiff.get(label)))
    return out
