"""The labels of a state on the voxels of its own CT, as other programs take them.

The case keeps labels on the grid that they were found or drawn on, cropped to the region that is modelled
(`docs/case.md`). A viewer, a planning system or a segmentation tool expects them on the scan's voxels.
"""

from __future__ import annotations

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.imaging.grid import in_lps_order, labels_resampled
from palpate.imaging.labels import OUTSIDE, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume


def labels_on_scan(case: CaseFolder, state: str, tissue: bool = False) -> Volume:
    """Label volume (uint8, values of LABELS) on the grid of the state's CT, in the rest frame, axes in LPS order.

    On the labels' own grid where the case has no CT of the state. tissue : keep the surrounding tissue, which is no
    organ but what the model holds of the rest of the body. Raises InputError as `CaseFolder.labels` does.
    """
    labels = without_tissue(case.labels(state), tissue)
    return labels_resampled(labels, case.ct(state)) if case.has(f"{state}_ct") else labels


def labels_in_own_frame(case: CaseFolder, state: str, tissue: bool = False) -> Volume:
    """Label volume on the grid of the state's CT, in that scan's own coordinates (LPS, mm), axes in LPS order.

    The case keeps the deformed labels in the rest frame, which the deformed scan's frame of reference does not name.
    tissue : as in `labels_on_scan`. Raises InputError as `CaseFolder.labels` and `CaseFolder.series` do.
    """
    labels = own_labels(case, state, tissue)
    return labels_resampled(labels, in_lps_order(case.series(state)[0]))


def own_labels(case: CaseFolder, state: str, tissue: bool = False) -> Volume:
    """Label volume on its own grid, moved into the coordinates of the state's own scan."""
    labels = without_tissue(case.labels(state), tissue)
    if state == "deformed":
        labels = labels.moved(np.linalg.inv(case.deformed_to_rest()).astype(np.float64))
    return labels


def bones_on_scan(case: CaseFolder, state: str) -> Volume | None:
    """Which bone each bone voxel is (values of BONE_PARTS), on the grid of the state's CT where it has one, rest frame."""
    bones = case.bones(state)
    return labels_resampled(bones, case.ct(state)) if bones is not None and case.has(f"{state}_ct") else bones


def without_tissue(labels: Volume, tissue: bool) -> Volume:
    """The labels, surrounding tissue set to outside unless `tissue`."""
    if tissue:
        return labels
    return labels.with_array(np.where(labels.array == SURROUNDING_TISSUE, OUTSIDE, labels.array).astype(np.uint8))
