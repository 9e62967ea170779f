"""Parts of a PDF that fit themselves to the page."""

from __future__ import annotations

from reportlab.lib.units import mm
from reportlab.pdfbase.pdfmetrics import stringWidth
from reportlab.platypus import Flowable, Paragraph

from palpate.ui.report import document as doc

# A picture is made smaller, to this share at most, rather than leave the rest of a page empty.
SMALLEST = 0.7


class FittingPicture(Flowable):
    """A picture over its caption that never part; somewhat smaller where only that lets it end the page it is on.

    path : of the picture. width, height : wanted, points.
    """

    def __init__(self, path: str, width: float, height: float, caption: Paragraph) -> None:
        super().__init__()
        self.spaceAfter = 3 * mm
        self._path, self._wanted, self._caption = path, (width, height), caption
        self._scale, self._below = 1.0, 0.0

    def wrap(self, aW: float, aH: float) -> tuple[float, float]:
        """Width and height taken of what is there; more than there is sends it to the next page."""
        width, height = self._wanted
        self._below = self._caption.wrap(aW, aH)[1] + 1 * mm
        share = (aH - self._below) / height
        self._scale = share if SMALLEST <= share < 1.0 else 1.0
        return width, self._scale * height + self._below

    def draw(self) -> None:
        """At the lower left of the place it was given."""
        width, height = (self._scale * size for size in self._wanted)
        self.canv.drawImage(self._path, 0.0, self._below, width, height)
        self._caption.drawOn(self.canv, 0.0, 0.0)


def column_widths(block: doc.Table, page: float, font: str, size: float) -> list[float]:
    """Shares of the page by the longest text of each column, within reason; none narrower than its header's longest word.

    page : its width, points. font, size : of the header.
    """
    rows = [block.header, *block.rows]
    lengths = [min(max(len(row[i]) for row in rows), 66) for i in range(len(block.header))]
    lengths = [max(length + 3, 10) for length in lengths]
    widths = [page * length / sum(lengths) for length in lengths]
    needed = [
        max((stringWidth(word, font, size) for word in head.split()), default=0.0) + 5 * mm for head in block.header
    ]
    narrow = [width < least for width, least in zip(widths, needed, strict=True)]
    if not any(narrow) or sum(needed) > page:
        return widths
    # What the narrow ones lack is taken from the others, each by what it has to spare.
    lack = sum(least - width for width, least, thin in zip(widths, needed, narrow, strict=True) if thin)
    spare = sum(width - least for width, least, thin in zip(widths, needed, narrow, strict=True) if not thin)
    return [
        least if thin else width - lack * (width - least) / spare
        for width, least, thin in zip(widths, needed, narrow, strict=True)
    ]
