"""Window and level: which Hounsfield units are black and which are white."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import LabelArray


@dataclass(frozen=True)
class WindowLevel:
    """centre : HU shown as middle grey. width : HU from black to white, at least 1."""

    centre: float
    width: float

    def moved(self, by_centre: float, by_width: float) -> WindowLevel:
        """Another window, kept within what a CT holds."""
        return WindowLevel(
            float(np.clip(self.centre + by_centre, -1024.0, 3071.0)), float(np.clip(self.width + by_width, 1.0, 4096.0))
        )


# What radiologists' workstations call them.
PRESETS: dict[str, WindowLevel] = {
    "Soft tissue": WindowLevel(40.0, 400.0),
    "Prostate": WindowLevel(40.0, 180.0),
    "Bone": WindowLevel(450.0, 1800.0),
    "Gas and fat": WindowLevel(-100.0, 1000.0),
    "Whole range": WindowLevel(500.0, 3000.0),
}


def apply_window(hu: NDArray[np.generic], window: WindowLevel) -> LabelArray:
    """Grey values 0 to 255 of any array of HU, same shape, C order. Linear as DICOM's LINEAR_EXACT function."""
    low = window.centre - window.width / 2.0
    scaled = np.subtract(hu, np.float32(low), dtype=np.float32)
    scaled *= np.float32(255.0 / window.width)
    np.clip(scaled, 0.0, 255.0, out=scaled)
    return np.ascontiguousarray(scaled.astype(np.uint8))
