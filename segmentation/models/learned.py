"""Organs by a learned model that the user has installed; none comes with the program.

A model is named NAME or NAME:WHERE, where WHERE is the folder that it lies in.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import nibabel
import numpy as np

from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.segmentation.models.monai_bundle import monai_masks

# TotalSegmentator's classes for each of our organs. It has no rectum of its own: its colon is more than that.
_TOTAL = {"prostate": "prostate", "bladder": "urinary_bladder"}
_LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])


def learned_masks(ct: Volume, model: str | None) -> Mapping[str, Volume]:
    """organ -> mask on the CT's grid, as far as the model knows it; nothing for None.

    Raises InputError when the model is unknown or not installed.
    """
    if model is None:
        return {}
    name, _, where = model.partition(":")
    if name not in MODELS:
        raise InputError(f"--model {model}: unknown; known are {', '.join(MODELS)}")
    return MODELS[name](ct, where)


def _total_segmentator(ct: Volume, _: str) -> Mapping[str, Volume]:
    """TotalSegmentator (Wasserthal et al. 2023) by its Python interface; it keeps its models in a place of its own."""
    try:
        from totalsegmentator.map_to_binary import class_map
        from totalsegmentator.python_api import totalsegmentator
    except ImportError as absent:
        raise InputError(
            f"--model totalsegmentator: it cannot be loaded ({absent}); install it into this environment "
            "(pip install TotalSegmentator), or leave --model out"
        ) from absent
    image = nibabel.Nifti1Image(ct.array.astype(np.int16), _LPS_TO_RAS @ ct.affine)
    result = totalsegmentator(image, None, ml=True, roi_subset=list(_TOTAL.values()), quiet=True)
    found = np.asarray(result.dataobj)
    if found.shape != ct.array.shape:
        raise InputError(
            f"--model totalsegmentator: it answered with {found.shape} voxels to a scan of {ct.array.shape}"
        )
    values = {name: value for value, name in class_map["total"].items()}
    masks = {organ: found == values[name] for organ, name in _TOTAL.items()}
    return {organ: ct.with_array(mask) for organ, mask in masks.items() if mask.any()}


def _monai(ct: Volume, where: str) -> Mapping[str, Volume]:
    if not where:
        raise InputError("--model monai: say which bundle: --model monai:FOLDER")
    return monai_masks(ct, Path(where))


MODELS: dict[str, Callable[[Volume, str], Mapping[str, Volume]]] = {
    "totalsegmentator": _total_segmentator,
    "monai": _monai,
}
