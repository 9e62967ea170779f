"""How a case is shown: everything on the screen that is not the case itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import msgspec

from palpate.ui.desktop.session.window_level import PRESETS, WindowLevel

MODES = ("rest", "deformed", "side by side", "blend")
OVERLAYS = ("labels", "stiffness", "map", "misfit", "none")


@dataclass
class Display:
    """crosshair : (x, y, z) mm LPS. blend : share of the deformed scan, 0 to 1. opacity : of the overlay.

    low_kpa, high_kpa : stiffness outside is not coloured; None is no limit. surest_factor : stiffness known to a larger
    factor than this is hatched instead of coloured; None hatches only what the pair does not tell at all. ball : the brush
    paints in 3D. paint_low_hu, paint_high_hu : the brush changes only voxels whose CT lies between. ruler : its two ends, mm.
    angle : end, vertex and other end, as far as they are clicked, mm.
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
    ruler: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    angle: tuple[tuple[float, float, float], ...] = ()

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
            out = msgspec.convert(data, cls)
        except msgspec.ValidationError:
            out = cls()
        out.tool, out.ruler, out.angle = "look", None, ()
        if out.mode not in MODES or out.overlay not in OVERLAYS:
            out.mode, out.overlay = MODES[0], OVERLAYS[0]
        return out
