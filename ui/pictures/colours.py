"""The colours of stiffness: one map, one scale for all pictures of a case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import Colormap, LogNorm, Normalize
from numpy.typing import NDArray

STIFFNESS_LABEL = "shear modulus G (kPa)"
# Perceptually uniform and rising in lightness, so that it reads the same in grey and by the colour-blind.
_MAP = "viridis"
# Beyond this ratio a linear scale would show the softer regions all alike.
_LOG_ABOVE = 8.0
OUTLINES = {"organ": "#ffffff", "bladder": "#ffe34d", "rectum": "#ff9c57", "bone": "#9fd8ff"}


@dataclass(frozen=True)
class StiffnessScale:
    """Colours for stiffness between low and high, kPa; logarithmic where ``log``."""

    low: float
    high: float
    log: bool = False

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
        return colormaps[_MAP]

    @property
    def norm(self) -> Normalize:
        """The scale as matplotlib takes it."""
        return LogNorm(self.low, self.high) if self.log else Normalize(self.low, self.high)

    def rgb(self, value: float) -> tuple[float, float, float]:
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
