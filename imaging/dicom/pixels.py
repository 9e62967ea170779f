"""Pixels of slices in HU."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pydicom
from pydicom.uid import UID

from palpate.core.arrays import NumberArray
from palpate.core.errors import InputError
from palpate.imaging.dicom.files import DAMAGE, quiet, read_file
from palpate.imaging.dicom.padding import AIR_HU, HIGHEST_HU, fill_around_discs, padded, padding_note
from palpate.imaging.dicom.slices import Slice

# Transfer syntaxes that pydicom does not name yet (DICOM PS3.6, 2024).
_NEWER = {
    "1.2.840.10008.1.2.4.110": "JPEG XL Lossless",
    "1.2.840.10008.1.2.4.111": "JPEG XL JPEG Recompression",
    "1.2.840.10008.1.2.4.112": "JPEG XL",
}
_INT16 = np.iinfo(np.int16)


def read_slices(slices: Sequence[Slice], notes: list[str] | None = None) -> NumberArray:
    """The slices' values, (n, rows, columns), HU; int16 where they are whole and fit, else float32. Padding is air.

    Raises InputError naming the file whose pixels are missing, damaged or compressed in a way no decoder here knows.
    """
    whole = all(float(s.slope).is_integer() and float(s.intercept).is_integer() for s in slices)
    values = np.empty((len(slices), *slices[0].shape), dtype=np.int32 if whole else np.float32)
    frames: dict[Path, NumberArray] = {}
    filled, saturated = 0, 0
    for index, each in enumerate(slices):
        if each.path not in frames:
            # Only the file being read is kept: a multi-frame file is decoded once, plain files do not pile up.
            frames = {each.path: _decode(each.path)}
        if each.frame >= len(frames[each.path]):
            raise InputError(
                f"{each.path} holds {len(frames[each.path])} frames but describes more; copy or export it again"
            )
        stored = frames[each.path][each.frame]
        outside = padded(stored, each)
        if stored.shape != each.shape:
            raise InputError(
                f"{each.path} has pixels of shape {stored.shape}, its header says {each.shape}; export it again"
            )
        values[index] = _in_hu(stored, each, whole)
        if outside is not None:
            values[index][outside] = AIR_HU
            filled += 1
        saturated += each.is_hu and bool((values[index] > HIGHEST_HU).any())
    if all(each.is_hu for each in slices):
        filled += fill_around_discs(values)
    if filled and notes is not None:
        notes.append(padding_note(filled))
    if saturated:
        values = np.minimum(values, HIGHEST_HU).astype(values.dtype)
        if notes is not None:
            notes.append(
                f"values above {HIGHEST_HU:g} HU within the body (metal) were set to that limit, on {saturated} slices"
            )
    if whole and _INT16.min <= values.min() and values.max() <= _INT16.max:
        return values.astype(np.int16)
    return values.astype(np.float32)


def _in_hu(stored: NumberArray, of: Slice, whole: bool) -> NumberArray:
    if whole:
        return stored.astype(np.int64) * int(of.slope) + int(of.intercept)
    return stored.astype(np.float64) * of.slope + of.intercept


def _decode(path: Path) -> NumberArray:
    dataset = read_file(path)
    if dataset is None:
        raise InputError(f"{path} is not DICOM any more; did it change while being read? Start again")
    if "PixelData" not in dataset:
        raise InputError(f"{path} holds no pixels; copy or export it again")
    try:
        with quiet():
            pixels = dataset.pixel_array
    except DAMAGE as error:
        raise InputError(
            f"{path} has pixels that cannot be decoded ({_syntax(dataset)}); {_remedy(dataset)}"
        ) from error
    return pixels[np.newaxis] if pixels.ndim == 2 else pixels


def _syntax(dataset: pydicom.Dataset) -> str:
    uid = _transfer_syntax(dataset)
    return _NEWER.get(uid) or str(uid.name) if uid else "transfer syntax not stated"


def _remedy(dataset: pydicom.Dataset) -> str:
    uid = _transfer_syntax(dataset)
    if uid and not uid.is_transfer_syntax:
        return "this compression is not known here: export the series uncompressed"
    if uid and uid.is_compressed:
        return "it is damaged or needs another decoder: export the series uncompressed"
    return "it is damaged: copy or export it again"


def _transfer_syntax(dataset: pydicom.Dataset) -> UID:
    """What the file says, which a damaged one may say as anything; blank where it does not."""
    return UID("".join(c for c in str(dataset.file_meta.get("TransferSyntaxUID") or "") if c.isprintable())[:64])
