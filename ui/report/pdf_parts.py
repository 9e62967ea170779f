"""Parts of a PDF that fit themselves to the page."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pypdf import PdfReader, PdfWriter, Transformation
from reportlab.lib.units import mm
from reportlab.pdfbase.pdfmetrics import stringWidth
from reportlab.platypus import Flowable, Paragraph

from palpate.ui.pictures.lettering import SMALLEST
from palpate.ui.report import document as doc


@dataclass(frozen=True)
class PlacedVector:
    """A PDF page that belongs on page `page` (from 0) of a report, its lower left corner at x, y; lengths in points."""

    pdf: bytes
    page: int
    x: float
    y: float
    width: float
    height: float


Placed = Callable[[PlacedVector], None]


def with_vectors(report: bytes, placed: Sequence[PlacedVector]) -> bytes:
    """The report with the figures drawn at their places."""
    writer = PdfWriter(clone_from=io.BytesIO(report))
    for one in placed:
        figure = PdfReader(io.BytesIO(one.pdf)).pages[0]
        size = figure.mediabox
        place = (
            Transformation()
            .scale(one.width / float(size.width), one.height / float(size.height))
            .translate(one.x, one.y)
        )
        writer.pages[one.page].merge_transformed_page(figure, place)
    out = io.BytesIO()
    writer.write(out)
    return out.getvalue()


class FittingPicture(Flowable):
    """A picture over its caption that never part; somewhat smaller where only that lets it end the page it is on.

    path : of the picture. width, height : wanted, points. vector : the picture as a PDF page, drawn instead of its pixels by
    `with_vectors`; `placed` hears where. Both are left out for a picture of pixels.
    """

    def __init__(
        self,
        path: str,
        width: float,
        height: float,
        caption: Paragraph,
        vector: bytes = b"",
        placed: Placed | None = None,
    ) -> None:
        super().__init__()
        self._vector, self._placed = vector, placed
        self.spaceAfter = 3 * mm
        self._path, self._wanted, self._caption = path, (width, height), caption
        self._scale, self._below = 1.0, 0.0
        self._given: float | None = None

    def at(self, scale: float) -> FittingPicture:
        """The same, no more fitting itself: as large as it is told, 1 for whole."""
        self._given = scale
        return self

    def heights(self, width: float) -> tuple[float, float]:
        """Of the whole picture, and of what stands below it with the space after, points."""
        return self._wanted[1], self._caption.wrap(width, 1e4)[1] + 1 * mm + self.spaceAfter

    def wrap(self, aW: float, aH: float) -> tuple[float, float]:
        """Width and height taken of what is there; more than there is sends it to the next page."""
        width, height = self._wanted
        self._below = self._caption.wrap(aW, aH)[1] + 1 * mm
        if self._given is not None:
            self._scale = self._given
            return width, self._scale * height + self._below
        share = (aH - self._below) / height
        self._scale = share if SMALLEST <= share < 1.0 else 1.0
        return width, self._scale * height + self._below

    def draw(self) -> None:
        """At the lower left of the place it was given."""
        width, height = (self._scale * size for size in self._wanted)
        if self._vector and self._placed is not None:
            x, y = self.canv.absolutePosition(0.0, self._below)
            self._placed(PlacedVector(self._vector, self.canv.getPageNumber() - 1, x, y, width, height))
        else:
            self.canv.drawImage(self._path, 0.0, self._below, width, height)
        self._caption.drawOn(self.canv, 0.0, 0.0)


class PictureRun(Flowable):
    """Pictures that follow each other, in the order of their numbers. As many as fit what is left of a page, somewhat smaller where need
    be, go on it.

    pictures : one or more.
    """

    def __init__(self, pictures: list[FittingPicture]) -> None:
        super().__init__()
        self.spaceAfter = pictures[0].spaceAfter
        self._pictures = pictures

    def wrap(self, aW: float, aH: float) -> tuple[float, float]:
        """More than there is, so that it is always asked to split."""
        return aW, aH + 1.0

    def split(self, aW: float, aH: float) -> list[Flowable]:
        """The pictures that fit and the run of the others; nothing where none does."""
        fitting: list[FittingPicture] = []
        for picture in self._pictures:
            if _scale([*fitting, picture], aW, aH) < SMALLEST:
                break
            fitting.append(picture)
        if not fitting:
            return []
        scale = min(1.0, _scale(fitting, aW, aH))
        others = self._pictures[len(fitting) :]
        return [*(picture.at(scale) for picture in fitting), *([PictureRun(others)] if others else [])]


def _scale(pictures: list[FittingPicture], width: float, height: float) -> float:
    """The scale at which pictures one below the other fill a height, points; the last needs no space after it, which is to spare."""
    whole, fixed = (sum(sizes) for sizes in zip(*(picture.heights(width) for picture in pictures), strict=True))
    return (height - fixed) / whole


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
