"""A CT with contours that a person drew, to judge a method by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.imaging.contours.rtstruct import is_rtstruct, read_rtstruct
from palpate.imaging.contours.user_labels import read_user_labels
from palpate.imaging.grid import in_lps_order
from palpate.imaging.labels import BLADDER, BONE, ORGAN_LABELS, RECTUM
from palpate.imaging.scans.scan import read_scan
from palpate.imaging.volume import Volume
from palpate.simulate.phantom import phantom
from palpate.simulate.scanner import Scanner

_VALUES = {"prostate": ORGAN_LABELS, "bladder": (BLADDER,), "rectum": (RECTUM,), "bone": (BONE,)}
PHANTOM = "phantom"
_PHANTOM_EXTENT_MM, _PHANTOM_SPACING_MM = np.array([350.0, 240.0, 150.0]), np.array([1.6, 1.6, 2.5])


@dataclass(frozen=True, eq=False)
class ContouredScan:
    """ct : HU. labels : the contours as one label volume on its grid. masks : organ -> mask, each as it was drawn: where
    contours overlap, in every one of them. name : for tables; it says nothing of the patient.
    """

    name: str
    ct: Volume
    labels: Volume
    masks: Mapping[str, Volume]


def contoured_scan(
    folder: Path, contours: Path, name: str, roi: Mapping[str, Sequence[str]] | None = None
) -> ContouredScan:
    """Reads a DICOM folder and its contours (RTSTRUCT, SEG, NIfTI, .seg.nrrd). Raises InputError when either cannot be read.

    roi : organ -> names of its structures, where the file's names do not tell.
    """
    ct, facts = read_scan(folder)
    drawn = read_user_labels(contours, ct, facts, roi)
    labels = in_lps_order(drawn.volume)
    masks = {organ: labels.with_array(np.isin(labels.array, values)) for organ, values in _VALUES.items()}
    if is_rtstruct(contours):
        found = read_rtstruct(contours, ct, facts, roi).masks
        masks |= {organ: in_lps_order(ct.with_array(mask)) for organ, mask in found.items() if organ in masks}
    return ContouredScan(name, in_lps_order(ct), labels, {k: m for k, m in masks.items() if m.array.any()})


def phantom_scan(seed: int = 3) -> ContouredScan:
    """A simulated scan of the analytic phantom, with its truth."""
    shape = np.ceil(_PHANTOM_EXTENT_MM / _PHANTOM_SPACING_MM).astype(int)
    low = phantom.ORIGIN_MM - 0.5 * (shape - 1) * _PHANTOM_SPACING_MM + np.array([2.0, 10.0, 8.0])
    grid = Volume.upright(low, _PHANTOM_SPACING_MM, shape)
    ct = Scanner().scan(phantom.hu, grid, seed=seed)
    index = np.indices(shape).reshape(3, -1).T.astype(float)
    labels = grid.with_array(phantom.labels(grid.to_lps(index)).reshape(shape))
    return ContouredScan(
        PHANTOM, ct, labels, {organ: labels.with_array(np.isin(labels.array, v)) for organ, v in _VALUES.items()}
    )
