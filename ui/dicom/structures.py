"""Which structures an RTSTRUCT holds: organs, the whole prostate beside its halves, femoral heads, by TG-263's names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.labels_on_scan import own_labels
from palpate.case.step_records import FemoralHeadRecord
from palpate.core.arrays import BoolArray, FloatArray
from palpate.imaging.contours.outlines import labels_on_slices
from palpate.imaging.labels import (
    BONE_PART_COLOURS,
    BONE_PART_VALUES,
    LABEL_COLOURS,
    LABELS,
    ORGAN_LABELS,
    PROSTATE_LEFT,
    SURROUNDING_TISSUE,
)
from palpate.imaging.volume import Volume
from palpate.ui.dicom.codes import TG263
from palpate.ui.dicom.label_segments import algorithm_types

WHOLE_PROSTATE = "Prostate"
FEMORAL_HEADS = {"left": "Femur_Head_L", "right": "Femur_Head_R"}
_WHOLE_COLOUR = (255, 255, 255)


@dataclass(frozen=True, eq=False)
class Structure:
    """One structure. mask : on slices of the CT, finer within them; first_slice : the CT's index of its first.

    algorithm : how it came about, in DICOM's words. kind : RT ROI interpreted type.
    """

    name: str
    mask: Volume
    first_slice: int
    colour: tuple[int, int, int]
    algorithm: str
    description: str = ""
    kind: str = "ORGAN"


def structures(case: CaseFolder, state: str, ct: Volume, tissue: bool = False) -> Iterator[Structure]:
    """The structures of a state. ct : its scan in its own frame."""
    drawn, first = labels_on_slices(own_labels(case, state, tissue), ct)
    present = [int(v) for v in np.unique(drawn.array) if v]
    types = algorithm_types(case, state)
    if any(value in ORGAN_LABELS for value in present):
        whole = drawn.with_array(np.isin(drawn.array, ORGAN_LABELS))
        how = types.get(LABELS[PROSTATE_LEFT], "MANUAL")
        yield Structure(WHOLE_PROSTATE, whole, first, _WHOLE_COLOUR, how, "both halves together")
    for value in present:
        red, green, blue, _ = LABEL_COLOURS[value]
        yield Structure(
            TG263[value], drawn.with_array(drawn.array == value), first, (red, green, blue),
            types.get(LABELS[value], "MANUAL"), kind="" if value == SURROUNDING_TISSUE else "ORGAN",
        )  # fmt: skip
    yield from _femoral_heads(case, state, ct)


def _femoral_heads(case: CaseFolder, state: str, ct: Volume) -> Iterator[Structure]:
    """The balls that the segmentation fitted to the femoral heads; none where the labels were not segmented here."""
    facts = case.read_json("segmentation.json") if case.has("segmentation.json") else {}
    known: Mapping[str, FemoralHeadRecord] = facts.get("states", {}).get(state, {}).get("femoral_heads", {})
    from_rest = np.linalg.inv(case.deformed_to_rest()) if state == "deformed" else np.eye(4)
    for side, head in known.items():
        centre = from_rest[:3, :3] @ np.array(head["centre_mm"]) + from_rest[:3, 3]
        ball, first = _ball(ct, centre, head["radius_mm"])
        red, green, blue, _ = BONE_PART_COLOURS[BONE_PART_VALUES[f"femur_{side}"]]
        if ball.array.any():
            words = f"ball fitted to the edge of the head, {head['seen']:.0%} of which the scan shows"
            yield Structure(FEMORAL_HEADS[side], ball, first, (red, green, blue), "AUTOMATIC", words)


def _ball(ct: Volume, centre: FloatArray, radius: float) -> tuple[Volume, int]:
    """The voxels of the CT whose centres lie in a ball, and the first slice's index."""
    reach = np.ceil(radius / ct.spacing) + 1.0
    middle = ct.to_index(centre[None])[0]
    low = np.clip(np.floor(middle - reach), 0, np.array(ct.array.shape) - 1).astype(int)
    high = np.clip(np.ceil(middle + reach), low, np.array(ct.array.shape) - 1).astype(int) + 1
    affine = ct.affine.copy()
    affine[:3, 3] = ct.to_lps(low[None].astype(np.float64))[0]
    empty = Volume(np.zeros(high - low, dtype=bool), affine)
    points = empty.to_lps(np.argwhere(~empty.array.astype(bool)).astype(np.float64))
    inside: BoolArray = (np.linalg.norm(points - centre, axis=1) <= radius).reshape(empty.array.shape)
    return empty.with_array(inside), int(low[2])
