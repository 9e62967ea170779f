"""What the slice pictures of a case are drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from palpate.imaging.labels import BLADDER, BONE, ORGAN_LABELS, RECTUM, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.ui.pictures.colours import label_rgb
from palpate.ui.pictures.planes import SAGITTAL, Plane, Slice, Window, centre_of, reach_of, reslice, share_of_label

CT_CENTRE_HU, CT_WIDTH_HU = 40.0, 400.0
AIR_HU = -1024.0


@dataclass(frozen=True, eq=False)
class CaseImages:
    """rest, deformed : label volumes in the rest frame. ct : the CT at rest, HU; None where the case has labels only.

    stiffness_kpa : organ label -> G in kPa. undetermined : organ labels whose stiffness the pair does not determine.
    """

    rest: Volume
    deformed: Volume | None = None
    ct: Volume | None = None
    stiffness_kpa: Mapping[int, float] = field(default_factory=dict)
    undetermined: frozenset[int] = frozenset()

    @property
    def determined(self) -> Mapping[int, float]:
        """Organ label -> G in kPa of those that the pair determines."""
        return {label: G for label, G in self.stiffness_kpa.items() if label not in self.undetermined}

    @property
    def organ(self) -> tuple[int, ...]:
        """Organ labels present at rest."""
        return tuple(label for label in ORGAN_LABELS if (self.rest.array == label).any())

    def window(self, plane: Plane, margin_mm: float = 32.0, step_mm: float = 0.5) -> Window:
        """The organ in the middle of a square view with its neighbours around it, cut through the organ's centre.

        The sagittal slice goes through the centre of the stiffest region instead: left and right half meet in the middle,
        and a slice along that seam would show neither.
        """
        x, y, z = (float(c) for c in centre_of(self.rest, self.organ))
        if plane is SAGITTAL and len(self.organ) > 1:
            stiffest = max(self.organ, key=lambda label: self.stiffness_kpa.get(label, 0.0))
            x = float(centre_of(self.rest, (stiffest,))[0])
        low, high = reach_of(self.rest, self.organ)
        return Window((x, y, z), float((high - low).max()) / 2.0 + margin_mm, step_mm)


def grey(images: CaseImages, plane: Plane, window: Window) -> Slice:
    """The background (rows, columns, 3), 0 to 1: CT in the soft tissue window, or the labels in quiet colours."""
    if images.ct is not None:
        ct = reslice(images.ct, plane, window, AIR_HU)
        value = np.clip((ct.values - CT_CENTRE_HU) / CT_WIDTH_HU + 0.5, 0.0, 1.0)
        return Slice(np.repeat(value[..., None], 3, axis=2), ct.extent)
    return _painted_labels(images.rest, plane, window)


def stiffness_slice(images: CaseImages, plane: Plane, window: Window) -> tuple[Slice, Slice]:
    """Stiffness in kPa, NaN where nothing is known, and where (1 or 0) the organ's stiffness is not told by the pair."""
    shares = {label: share_of_label(images.rest, label, plane, window) for label in images.organ}
    extent = next(iter(shares.values())).extent
    stack = np.stack([shares[label].values for label in images.organ])
    winner = np.array(images.organ)[np.argmax(stack, axis=0)]
    inside = stack.sum(axis=0) >= 0.5
    value = np.full(winner.shape, np.nan)
    for label, G in images.determined.items():
        value[inside & (winner == label)] = G
    return Slice(value, extent), Slice((inside & np.isnan(value)).astype(float), extent)


def _painted_labels(labels: Volume, plane: Plane, window: Window) -> Slice:
    drawn = (SURROUNDING_TISSUE, BONE, BLADDER, RECTUM, *ORGAN_LABELS)
    shares = [share_of_label(labels, label, plane, window) for label in drawn]
    colours = {label: np.array(label_rgb(label)) for label in drawn}
    quiet = {label: 0.45 * colour + 0.12 for label, colour in colours.items()}
    quiet[SURROUNDING_TISSUE] = np.full(3, 0.32)
    quiet[BONE] = np.full(3, 0.85)
    quiet |= {label: np.full(3, 0.5) for label in ORGAN_LABELS}
    rgb = sum(share.values[..., None] * quiet[label] for label, share in zip(drawn, shares, strict=True))
    return Slice(np.clip(np.asarray(rgb), 0.0, 1.0), shares[0].extent)
