"""How a case is shown: everything on the screen that is not the case itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

import msgspec
import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import LabelArray
from palpate.ui.pictures.colours import COLOUR_MAPS, STIFFNESS_SCALE, StiffnessScale


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


MODES = ("rest", "deformed", "side by side", "blend")
OVERLAYS = ("labels", "stiffness", "map", "misfit", "none")
# Overlays under which labels are not seen.
OVER_LABELS = ("stiffness", "map", "misfit")
# Tools that change labels.
PAINTS = ("brush", "eraser", "lasso", "polygon")
# The same for every patient, so that two windows compare; kPa of G. The first is the report's.
SCALES = {
    "5 to 200 kPa, log": STIFFNESS_SCALE,
    "5 to 500 kPa, log": StiffnessScale(5.0, 500.0, log=True),
    "0 to 50 kPa": StiffnessScale(0.0, 50.0),
    "0 to 100 kPa": StiffnessScale(0.0, 100.0),
    "0 to 200 kPa": StiffnessScale(0.0, 200.0),
}
_REPORTS = next(iter(SCALES))


@dataclass
class Display:
    """crosshair : (x, y, z) mm LPS. blend : share of the deformed scan, 0 to 1. opacity : of the overlay.

    low_kpa, high_kpa : stiffness outside is not coloured; None is no limit. surest_factor : stiffness known to a larger
    factor than this is hatched instead of coloured; None hatches only what the pair does not tell at all. ball : the brush
    paints in 3D. paint_low_hu, paint_high_hu : the brush changes only voxels whose CT lies between. scale : one of
    SCALES. colours : one of `pictures.colours.COLOUR_MAPS`. label_opacity : by label, share of `opacity`; 0 hides the label
    and its outline.
    """

    crosshair: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mode: str = "rest"
    blend: float = 0.5
    centre: float = PRESETS["Soft tissue"].centre
    width: float = PRESETS["Soft tissue"].width
    overlay: str = "labels"
    opacity: float = 0.45
    outlines: bool = True
    low_kpa: float | None = None
    high_kpa: float | None = None
    surest_factor: float | None = None
    tool: str = "look"
    label: int = 1
    radius_mm: float = 4.0
    seed_name: str = "prostate"
    ball: bool = False
    paint_low_hu: float | None = None
    paint_high_hu: float | None = None
    scale: str = _REPORTS
    colours: str = COLOUR_MAPS[0]
    label_opacity: dict[int, float] = field(default_factory=dict)

    def opacity_of(self, label: int) -> float:
        """Share of the overlay's opacity that a label has, 0 to 1."""
        return self.label_opacity.get(label, 1.0)

    @property
    def window(self) -> WindowLevel:
        """Grey window."""
        return WindowLevel(self.centre, self.width)

    def to_dict(self) -> dict[str, object]:
        """JSON-able form."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, object]) -> Display:
        """A display as it was; what is missing or of another version is as by default, and all of it where one is of another type."""
        try:
            out = msgspec.convert(data, cls, str_keys=True)
        except msgspec.ValidationError:
            out = cls()
        out.tool = "look"
        if out.mode not in MODES or out.overlay not in OVERLAYS:
            out.mode, out.overlay = MODES[0], OVERLAYS[0]
        if out.scale not in SCALES or out.colours not in COLOUR_MAPS:
            out.scale, out.colours = _REPORTS, COLOUR_MAPS[0]
        return out
