"""What a colour means, in every picture, in the window and in the files for 3D Slicer: one scale of stiffness, one palette of labels.

The palette itself stands in `palpate.imaging.labels`, which writes it into files; here it is made ready for drawing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import Colormap, LogNorm, Normalize
from numpy.typing import NDArray

from palpate.imaging.labels import BLADDER, BONE, LABEL_COLOURS, LABEL_VALUES, ORGAN_LABELS, RECTUM

RGB = tuple[float, float, float]
STIFFNESS_LABEL = "shear modulus G (kPa)"
# The first is perceptually uniform and rises in lightness, so that it reads the same in grey and by the colour-blind: report and
# exports have it. The window offers the others; turbo is the rainbow of elastography with steps that the eye sees alike.
COLOUR_MAPS = ("viridis", "cividis", "inferno", "turbo", "gray")
# Beyond this ratio a linear scale would show the softer regions all alike.
_LOG_ABOVE = 8.0
# Signed distances, blue inside and red outside: of the misfit, and of nothing else.
DISTANCE_MAP = "RdBu_r"
# What stands around the organ in 3D is seen through; shares.
AROUND_OPACITY: Mapping[int, float] = {BONE: 0.25, BLADDER: 0.3, RECTUM: 0.35}
# Of an organ in 3D whose stiffness is not told, or not shown.
UNTOLD: RGB = (0.6, 0.6, 0.6)


def label_rgb(label: int) -> RGB:
    """Red, green, blue (0 to 1) of a label."""
    r, g, b = (channel / 255.0 for channel in LABEL_COLOURS[label][:3])
    return r, g, b


def label_hex(label: int) -> str:
    """A label's colour as ``#rrggbb``; for lines and charts too."""
    return "#{:02x}{:02x}{:02x}".format(*LABEL_COLOURS[label][:3])


def region_hex(name: str) -> str:
    """The same by a region's name; grey for a name that is no label."""
    return label_hex(LABEL_VALUES[name]) if name in LABEL_VALUES else "#777777"


# Labels by their outline on a slice: their own colour; the organ's is white, because what it is filled with has a meaning.
OUTLINES: Mapping[int, str] = {
    **dict.fromkeys(ORGAN_LABELS, "#ffffff"),
    **{label: label_hex(label) for label in (BLADDER, RECTUM, BONE)},
}


@dataclass(frozen=True)
class StiffnessScale:
    """Colours for stiffness between low and high, kPa; logarithmic where ``log``. colours : one of COLOUR_MAPS."""

    low: float
    high: float
    log: bool = False
    colours: str = COLOUR_MAPS[0]

    @classmethod
    def of(cls, values: Iterable[float]) -> StiffnessScale:
        """A scale that holds all values and ends at a round figure."""
        known = [v for v in values if np.isfinite(v) and v > 0]
        if not known:
            return cls(0.0, 100.0)
        if max(known) / min(known) > _LOG_ABOVE:
            return cls(0.8 * min(known), 1.25 * max(known), True)
        return cls(0.0, _round_up(1.05 * max(known)))

    @property
    def colormap(self) -> Colormap:
        """The map."""
        return colormaps[self.colours]

    @property
    def norm(self) -> Normalize:
        """The scale as matplotlib takes it."""
        return LogNorm(self.low, self.high) if self.log else Normalize(self.low, self.high)

    def rgb(self, value: float) -> RGB:
        """Red, green, blue (0 to 1) of a stiffness."""
        r, g, b, _ = self.colormap(self.norm(value))
        return float(r), float(g), float(b)


def map_scale(regional: Iterable[float], arrays: Mapping[str, NDArray[np.generic]]) -> StiffnessScale:
    """One scale for regional values, kPa, and for what a map tells. arrays : of `palpate.core.identify.map.stiffness_map.StiffnessMap`."""
    told = np.asarray(arrays["told"], dtype=bool)
    return StiffnessScale.of([*regional, *np.exp(np.asarray(arrays["ln_G"], dtype=float))[told].tolist()])


def _round_up(value: float) -> float:
    step = 10.0 ** np.floor(np.log10(value)) / 2.0
    return float(np.ceil(value / step) * step)
