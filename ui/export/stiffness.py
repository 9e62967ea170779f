"""The stiffness of a case as an image, for the exporters."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.identified import identified_regions
from palpate.case.labels_on_scan import labels_on_scan
from palpate.core.files.atomic import atomic_path
from palpate.imaging.contours.nifti_labels import write_nifti
from palpate.imaging.labels import LABEL_VALUES
from palpate.imaging.volume import Volume

# Slices kept on both sides of the organ; the others would hold nothing.
_MARGIN = 2


def stiffness_of(case: CaseFolder) -> dict[int, float]:
    """Shear modulus G, kPa, by organ label. Raises InputError when the case has not been identified."""
    found = identified_regions(case)
    return {LABEL_VALUES[name]: region.G_kpa for name, region in found.items() if region.G_kpa is not None}


def stiffness_volume(case: CaseFolder) -> Volume:
    """Shear modulus G, kPa, float32, on the grid of the scan at rest (of its labels without CT); 0 where none was identified."""
    labels = labels_on_scan(case, "rest")
    value = np.zeros(labels.array.shape, dtype=np.float32)
    for label, G in stiffness_of(case).items():
        value[labels.array == label] = G
    return labels.with_array(value)


def interval_volumes(case: CaseFolder) -> dict[str, Volume] | None:
    """Ends of each region's 95 % interval, kPa, float32, by "low" and "high", on the grid of `stiffness_volume`; 0 outside.

    None where no interval is known. Raises InputError when the case has not been identified.
    """
    labels = labels_on_scan(case, "rest")
    ends = {name: found.ci95_kpa for name, found in identified_regions(case).items() if found.ci95_kpa is not None}
    out = {}
    for index, word in enumerate(("low", "high")):
        value = np.zeros(labels.array.shape, dtype=np.float32)
        for name, interval in ends.items():
            value[labels.array == LABEL_VALUES[name]] = interval[index]
        out[word] = labels.with_array(value)
    return out if ends else None


def near_organ(G: Volume) -> Volume:
    """The slices that hold the organ and some beside them."""
    slices = np.flatnonzero(G.array.any(axis=(0, 1)))
    first, last = max(slices[0] - _MARGIN, 0), min(slices[-1] + _MARGIN + 1, G.array.shape[2])
    affine = G.affine.copy()
    affine[:3, 3] = G.to_lps(np.array([[0.0, 0.0, first]]))[0]
    return Volume(G.array[:, :, first:last], affine)


def written_nifti(path: Path, volume: Volume) -> Path:
    """Writes a volume, whole or not at all; returns its path. Raises InputError where it cannot."""
    with atomic_path(path) as temporary:
        write_nifti(temporary, volume)
    return path
