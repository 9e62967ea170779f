"""What a colour means, in every picture, in the window and in the files for 3D Slicer: one scale of stiffness, one palette of labels.

The palette itself stands in `palpate.imaging.labels`, which writes it into files; here it is made ready for drawing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from matplotlib import colormaps
from matplotlib.colors import Colormap, LogNorm, Normalize

from palpate.imaging.labels import BLADDER, BONE, LABEL_COLOURS, LABEL_VALUES, ORGAN_LABELS, RECTUM

RGB = tuple[float, float, float]
STIFFNESS_LABEL = "shear modulus G (kPa)"
# The first is perceptually uniform and rises in lightness, so that it reads the same in grey and by the colour-blind: report and
# exports have it. The window offers the others; turbo is the rainbow of elastography with steps that the eye sees alike.
COLOUR_MAPS = ("viridis", "cividis", "inferno", "turbo", "gray")
# Signed distances, blue inside and red outside: of the misfit, and of nothing else.
DISTANCE_MAP = "RdBu_r"
# What stands around the organ in 3D is seen through; shares.
AROUND_OPACITY: Mapping[int, float] = {BONE: 0.25, BLADDER: 0.3, RECTUM: 0.35}
# Of an organ in 3D whose stiffness is not told, or not shown.
UNDETERMINED: RGB = (0.6, 0.6, 0.6)


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


# The scale of every picture and every patient, kPa: published shear moduli of prostates (4 to 37, ui/report/first_page.py) and five times
# the hardest. Logarithmic, since errors of stiffness are factors; a stiffness beyond an end has the colour of that end.
STIFFNESS_SCALE = StiffnessScale(5.0, 200.0, log=True)
