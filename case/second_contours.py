"""Second set of contours of a scan of the case, moved into the rest frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.case.aligned_labels import in_own_frame
from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.imaging.contours.readers import reader_by_suffix
from palpate.imaging.contours.user_labels import lying_in, read_label_volume, read_user_labels
from palpate.imaging.grid import in_lps_order
from palpate.imaging.labels import ORGAN_LABELS
from palpate.imaging.volume import Volume


def second_contours(case: CaseFolder, state: str, path: Path) -> Volume:
    """Label volume in the rest frame, axes in LPS order.

    state : "rest" or "deformed", the scan that was contoured. path : contours in any format of `palpate import`, in the
    scan's own coordinates or in those of `palpate export`. Raises InputError naming the file when it is missing,
    unreadable or holds no prostate, or when it is no label volume and the case has no CT.
    """
    if not path.is_file():
        raise InputError(f"{path} is not there; give the labels drawn on the {state} scan")
    if case.has(f"{state}_ct"):
        ct, facts = case.series(state)
        contours = read_user_labels(path, ct, facts, placed=state == "rest")
        if state == "deformed":
            case_grid = case.labels(state) if case.has_labels(state) else None
            contours = lying_in(in_own_frame(contours, ct, case.deformed_to_rest(), case_grid), ct, path)
        volume = contours.volume
    elif (reader := reader_by_suffix(path)) is not None and reader.holds_voxels:
        volume = read_label_volume(path).volume
    else:
        raise InputError(f"{path}: this case has no CT to place contours on; give a label volume")
    if not np.isin(volume.array, ORGAN_LABELS).any():
        raise InputError(f"{path} holds no prostate (labels 1, 2); draw it")
    return in_lps_order(volume.moved(case.deformed_to_rest()) if state == "deformed" else volume)
