"""A person's contours of the scans of a case: the label volumes that the import step wrote."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.core.arrays import BoolArray, LabelArray
from palpate.core.errors import InputError
from palpate.imaging.contours.label_reader import UserLabels
from palpate.imaging.contours.nifti_labels import read_labels
from palpate.imaging.grid import in_lps_order
from palpate.imaging.labels import BLADDER, BONE, ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume
from palpate.segmentation.working_grid import mask_on


@dataclass(frozen=True, eq=False)
class Contours:
    """Contours of one scan.

    volume : label volume in the rest frame, axes in LPS order. organs : masks of those of prostate, bladder and rectum
    that are contoured. bone : mask of the contoured bone, or None. prostate_labels : labels 1 and 2 on the volume's
    grid where both halves are contoured; None where the prostate is still to be divided into left and right.
    """

    volume: Volume
    organs: Mapping[str, Volume]
    bone: Volume | None
    prostate_labels: LabelArray | None

    def bone_on(self, grid: Volume) -> BoolArray:
        """Mask of the contoured bone on a grid; empty where no bone is contoured."""
        return np.zeros(grid.array.shape, dtype=bool) if self.bone is None else mask_on(self.bone, grid)


def read_contours(case: CaseFolder, state: str) -> Contours | None:
    """Contours of one state ("rest" or "deformed"); None where it has none. Raises InputError naming an unreadable
    file.
    """
    name = f"{state}_user.nii.gz"
    if not case.has(name):
        return None
    volume = in_lps_order(read_labels(case.file(name)))
    facts = case.read_json("user_labels.json") if case.has("user_labels.json") else {}
    is_split = facts.get(state, {}).get("prostate_is_split", len(np.unique(volume.array[volume.array > 0])) > 1)
    return _contours(volume, bool(is_split))


def contours_of_file(labels: UserLabels, path: Path) -> Contours:
    """Contours of a file that was read. path : that file, for the error. Raises InputError when there is no
    prostate.
    """
    contours = _contours(in_lps_order(labels.volume), labels.prostate_is_split)
    if "prostate" not in contours.organs:
        raise InputError(f"{path} holds no prostate; draw it, or say which structure it is")
    return contours


def contours_of_volume(labels: Volume, is_split: bool = False) -> Contours:
    """Contours of a label volume. is_split : whether labels 1 and 2 are contoured halves of the prostate."""
    return _contours(in_lps_order(labels), is_split)


def _contours(volume: Volume, is_split: bool) -> Contours:
    values = {"prostate": ORGAN_LABELS, "bladder": (BLADDER,), "rectum": (RECTUM,)}
    organs = {organ: volume.with_array(np.isin(volume.array, labels)) for organ, labels in values.items()}
    organs = {organ: mask for organ, mask in organs.items() if mask.array.any()}
    bone = volume.with_array(volume.array == BONE)
    halves = np.where(np.isin(volume.array, ORGAN_LABELS), volume.array, 0).astype(np.uint8)
    return Contours(
        volume, organs, bone if bone.array.any() else None, halves if is_split and "prostate" in organs else None
    )
