"""What lies over the grey slices: a colour for every label, as a table that is cheap to change."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from skimage import measure

from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.labels import BONE, LABEL_COLOURS, SURROUNDING_TISSUE
from palpate.ui.desktop.session.display import PAINTS, Display
from palpate.ui.desktop.slices.slice_sampling import SampledSlice
from palpate.ui.pictures.colours import DISTANCE_MAP, StiffnessScale
from palpate.ui.report.regions import RegionStiffness

RGBA = tuple[int, int, int, int]


@dataclass(frozen=True)
class Painted:
    """table : label -> red, green, blue, alpha (0 to 255). hatched : labels whose stiffness is not shown because it is not known
    well enough."""

    table: Mapping[int, RGBA]
    hatched: frozenset[int] = frozenset()


def painted_labels(display: Display) -> Painted:
    """Every label in its colour; tissue all around stays as it is unless it is being drawn."""
    alpha = round(255 * display.opacity)
    table = {
        label: (*rgb, round(alpha * display.opacity_of(label))) for label, (*rgb, _) in LABEL_COLOURS.items() if label
    }
    table[BONE] = (*table[BONE][:3], table[BONE][3] // 3)
    if not (display.label == SURROUNDING_TISSUE and display.tool in PAINTS):
        table.pop(SURROUNDING_TISSUE)
    return Painted({label: (c[0], c[1], c[2], c[3]) for label, c in table.items()})


def painted_stiffness(display: Display, regions: Iterable[RegionStiffness], scale: StiffnessScale) -> Painted:
    """The organ by stiffness: nothing outside the threshold, hatched where the pair does not tell enough."""
    table: dict[int, RGBA] = {}
    hatched = set()
    for region in regions:
        if not is_sure(region, display.surest_factor):
            hatched.add(region.label)
        elif is_within(region.G, display):
            r, g, b = (round(255 * c) for c in scale.rgb(region.G))
            table[region.label] = (r, g, b, round(255 * display.opacity * display.opacity_of(region.label)))
    return Painted(table, frozenset(hatched))


def is_sure(region: RegionStiffness, factor: float | None) -> bool:
    """Whether the pair tells this stiffness, to the factor asked for (95 % interval from G / factor to G times factor)."""
    if not region.determined or factor is None:
        return region.determined
    return region.ln_sd is not None and float(np.exp(1.96 * region.ln_sd)) <= factor


def is_within(G: float, display: Display) -> bool:
    """Whether a stiffness, kPa, lies within the threshold."""
    low = -np.inf if display.low_kpa is None else display.low_kpa
    high = np.inf if display.high_kpa is None else display.high_kpa
    return bool(low <= G <= high)


def only_at_rest(overlay: str, state: str) -> str:
    """Why an overlay is not shown on a scan, in words; empty where it is."""
    return f"{overlay} is shown at rest only" if overlay in ("map", "misfit") and state == "deformed" else ""


def outlines(sampled: SampledSlice, label: int) -> list[FloatArray]:
    """Lines (n, 2) of (across, down) mm around a label in a slice of labels."""
    inside = np.pad(np.asarray(sampled.values == label, dtype=np.float32), 1)
    if not inside.any():
        return []
    left, _, _, top = sampled.extent
    step_a, step_d = sampled.step
    down = 1.0 if sampled.extent[2] > top else -1.0
    lines = measure.find_contours(inside, 0.5)
    # Row r of the padded picture has its centre r - 1/2 pixels below the top edge.
    return [np.column_stack([left + (c[:, 1] - 0.5) * step_a, top + down * (c[:, 0] - 0.5) * step_d]) for c in lines]


def residual_rgb(residual: FloatArray, limit: float) -> LabelArray:
    """Colours (n, 3) of residuals (n,) mm: blue inside (-), red outside (+), white where the model meets the scan."""
    rgba = colormaps[DISTANCE_MAP]((np.clip(residual / limit, -1.0, 1.0) + 1.0) / 2.0)
    return np.rint(255.0 * rgba[:, :3]).astype(np.uint8)


def residual_limit(residual: FloatArray) -> float:
    """A round limit, mm, for the colours of residuals: all but the largest 2 % lie within."""
    return max(0.5, float(np.ceil(2.0 * np.percentile(np.abs(residual), 98)) / 2.0))
