"""Contours that a person drew on the scans of a case, as label volumes written by the import step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.core.arrays import BoolArray, LabelArray
from palpate.core.errors import InputError
from palpate.imaging.contours.nifti_labels import read_labels
from palpate.imaging.contours.user_labels import UserLabels
from palpate.imaging.grid import in_lps_order
from palpate.imaging.labels import BLADDER, BONE, ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume
from palpate.segmentation.working_grid import mask_on


@dataclass(frozen=True, eq=False)
class Drawn:
    """Contours of one scan.

    volume : label volume in the rest frame, axes in LPS order. organs : masks of prostate, bladder and rectum, those that
    were drawn. bone : mask of the drawn bone, or None. prostate_labels : labels 1 and 2 on the volume's grid where the
    halves were drawn, else None: the split into left and right is still to be made.
    """

    volume: Volume
    organs: Mapping[str, Volume]
    bone: Volume | None
    prostate_labels: LabelArray | None

    def bone_on(self, grid: Volume) -> BoolArray:
        """Mask of the drawn bone on a grid; empty where none was drawn."""
        return np.zeros(grid.array.shape, dtype=bool) if self.bone is None else mask_on(self.bone, grid)


def drawn_labels(case: CaseFolder, state: str) -> Drawn | None:
    """Contours of one state ("rest" or "deformed"); None where it has none. Raises InputError naming an unreadable file."""
    name = f"{state}_user.nii.gz"
    if not case.has(name):
        return None
    volume = in_lps_order(read_labels(case.file(name)))
    facts = case.read_json("user_labels.json") if case.has("user_labels.json") else {}
    is_split = facts.get(state, {}).get("prostate_is_split", len(np.unique(volume.array[volume.array > 0])) > 1)
    return _drawn(volume, bool(is_split))


def drawn_of(labels: UserLabels, path: Path) -> Drawn:
    """Contours of a file that was read. path : that file, for the error. Raises InputError when there is no prostate."""
    drawn = _drawn(in_lps_order(labels.volume), labels.prostate_is_split)
    if "prostate" not in drawn.organs:
        raise InputError(f"{path} holds no prostate; draw it, or say which structure it is")
    return drawn


def drawn_of_volume(labels: Volume, is_split: bool = False) -> Drawn:
    """Contours of a label volume. is_split : whether labels 1 and 2 are drawn halves of the prostate."""
    return _drawn(in_lps_order(labels), is_split)


def _drawn(volume: Volume, is_split: bool) -> Drawn:
    values = {"prostate": ORGAN_LABELS, "bladder": (BLADDER,), "rectum": (RECTUM,)}
    organs = {organ: volume.with_array(np.isin(volume.array, labels)) for organ, labels in values.items()}
    organs = {organ: mask for organ, mask in organs.items() if mask.array.any()}
    bone = volume.with_array(volume.array == BONE)
    halves = np.where(np.isin(volume.array, ORGAN_LABELS), volume.array, 0).astype(np.uint8)
    return Drawn(
        volume, organs, bone if bone.array.any() else None, halves if is_split and "prostate" in organs else None
    )
