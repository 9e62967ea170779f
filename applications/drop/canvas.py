"""What is written around the pictures of a drop: whose organ, time, scale bar, colours in kPa, research use."""

from __future__ import annotations

import numpy as np
from matplotlib.font_manager import FontProperties, findfont
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from palpate.applications.drop.stage import DropStage

Picture = NDArray[np.uint8]

SCALE_BAR_MM = 20.0
MARK = "Research use only \N{EN DASH} not for diagnosis"
_TOP, _BOTTOM, _EDGE = 58, 96, 16
_INK, _QUIET = (20, 24, 28), (95, 102, 110)


class Canvas:
    """The still part of every picture; `picture` adds what moves. pixels_per_mm : of the organs' pictures."""

    def __init__(self, stage: DropStage, pixels_per_mm: float) -> None:
        self._stage = stage
        width, height = stage.size
        self._still = Image.new("RGB", (width * len(stage.organs), height + _TOP + _BOTTOM), "white")
        pen = ImageDraw.Draw(self._still)
        for k, organ in enumerate(stage.organs):
            pen.text((k * width + _EDGE, 8), organ.title, _INK, _font(20, bold=True))
            pen.text((k * width + _EDGE, 34), organ.subtitle, _QUIET, _font(14))
            for letter, x in (("R", _EDGE), ("L", width - _EDGE - 12)):
                pen.text((k * width + x, _TOP + height // 2), letter, _QUIET, _font(16, bold=True))
        self._scale_bar(pen, pixels_per_mm)
        self._colours(pen)
        pen.text((self._still.width - _EDGE, self._still.height - 12), MARK, _INK, _font(14, bold=True), anchor="rs")

    def picture(self, drawn: list[Picture], time: float) -> Picture:
        """(height, width, 3): one drawn picture of each organ, at a time in s."""
        out = self._still.copy()
        width, _ = self._stage.size
        pen = ImageDraw.Draw(out)
        for k, one in enumerate(drawn):
            out.paste(Image.fromarray(one), (k * width, _TOP))
            for letter, x in (("R", _EDGE), ("L", width - _EDGE - 12)):
                pen.text((k * width + x, _TOP + self._stage.size[1] // 2), letter, _QUIET, _font(16, bold=True))
        y = _TOP + self._stage.size[1] + 30
        text = f"{1e3 * time:4.0f} ms"
        if slower(self._stage) >= 1.5:
            text += f", {slower(self._stage):.0f} times slower"
        pen.text((out.width - _EDGE, y), text, _INK, _font(18), anchor="rs")
        return np.asarray(out)

    def _scale_bar(self, pen: ImageDraw.ImageDraw, pixels_per_mm: float) -> None:
        y = _TOP + self._stage.size[1] + 24
        end = _EDGE + SCALE_BAR_MM * pixels_per_mm
        pen.rectangle((_EDGE, y - 4, end, y), fill=_INK)
        pen.text((end + 8, y + 3), f"{SCALE_BAR_MM:g} mm", _INK, _font(14), anchor="ls")

    def _colours(self, pen: ImageDraw.ImageDraw) -> None:
        """The bar under the scale bar, its figures below, its name beside."""
        x, y, length = _EDGE, _TOP + self._stage.size[1] + 46, 220
        for k in range(length):
            colour = self._stage.colours[int(k / length * len(self._stage.colours))]
            pen.line((x + k, y, x + k, y + 12), fill=tuple(round(255 * c) for c in colour))
        for place, text in self._stage.bar:
            at = x + place * (length - 1)
            pen.line((at, y + 12, at, y + 16), fill=_INK)
            pen.text((at, y + 32), text, _INK, _font(13), anchor="ls" if place < 0.03 else "ms")
        pen.text((x + length + 12, y + 11), self._stage.bar_title, _INK, _font(13), anchor="ls")


def slower(stage: DropStage) -> float:
    """How many times slower than real the film runs."""
    if len(stage.times) < 2:
        return 1.0
    return 1.0 / (stage.per_second * float(stage.times[1] - stage.times[0]))


def _font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(findfont(FontProperties(family="DejaVu Sans", weight="bold" if bold else "normal")), size)
