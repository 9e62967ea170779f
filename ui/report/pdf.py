"""A report as PDF, A4."""

from __future__ import annotations

import io
from collections.abc import Iterable
from functools import partial
from itertools import chain, groupby
from pathlib import Path
from xml.sax.saxutils import escape

import matplotlib
from PIL import Image as PillowImage
from reportlab import rl_config
from reportlab.lib import colors
from reportlab.lib.pagesizes import A4
from reportlab.lib.styles import ParagraphStyle
from reportlab.lib.units import mm
from reportlab.pdfbase import pdfmetrics
from reportlab.pdfbase.ttfonts import TTFont
from reportlab.pdfgen.canvas import Canvas
from reportlab.platypus import (
    CondPageBreak,
    Flowable,
    KeepTogether,
    ListFlowable,
    Paragraph,
    SimpleDocTemplate,
    Table,
    TableStyle,
)

from palpate.ui.report import document as doc
from palpate.ui.report.pdf_parts import FittingPicture, PictureRun, Placed, PlacedVector, column_widths, with_vectors

# matplotlib brings a free font that has Greek letters; PDF's own fonts have none.
_FONT, _BOLD = "DejaVuSans", "DejaVuSans-Bold"
_CELL = 9.0
_MARGIN = 17.0 * mm
_WIDTH = A4[0] - 2.0 * _MARGIN
# Of reportlab's frames: taken off the margins, so that text, tables and pictures begin where the footer does.
_PADDING = 6.0
_ENOUGH = 70.0 * mm  # of a page, for a heading and the beginning of its table
# Pictures as bytes: reportlab's own text of them (ASCII base 85) is written by a loop in Python, and is a quarter longer.
rl_config.useA85 = 0
_INK, _QUIET = colors.HexColor("#1b1f24"), colors.HexColor("#3d4650")


def write_pdf(document: doc.Document, path: Path) -> Path:
    """Writes the report; its footer stands on every page."""
    document = doc.numbered(document)
    _register_fonts()
    stream, placed = io.BytesIO(), list[PlacedVector]()
    template = SimpleDocTemplate(
        stream, pagesize=A4, leftMargin=_MARGIN - _PADDING, rightMargin=_MARGIN - _PADDING, topMargin=18.0 * mm, bottomMargin=18.0 * mm,
        title=f"{document.title}: {document.subtitle}", author="Palpate", subject=document.footer, lang="en",
    )  # fmt: skip
    decorate = partial(_decorate, document)
    template.build(_story(document, placed.append), onFirstPage=decorate, onLaterPages=decorate)
    path.write_bytes(with_vectors(stream.getvalue(), placed))
    return path


def _story(document: doc.Document, placed: Placed) -> list[Flowable]:
    story: list[Flowable] = [Paragraph(escape(document.title), _style(18, bold=True, after=1))]
    story.append(Paragraph(escape(document.subtitle), _style(9, colour=_QUIET, after=3)))
    story.append(_notice(doc.Notice("\n".join((document.footer, *(notice.text for notice in document.notices))))))
    for section in document.sections:
        heading = Paragraph(escape(section.title), _style(13, bold=True, before=4, after=1.5))
        on_paper = [block for block in section.blocks if not isinstance(block, doc.Interactive)]
        flowables = [_flowables(block, placed) for block in on_paper]
        led = 1 + (len(on_paper) > 1 and isinstance(on_paper[0], doc.Paragraph) and isinstance(on_paper[1], doc.Table))
        first = list(chain.from_iterable(flowables[:led]))
        story += [*_headed(heading, first), *_runs(chain.from_iterable(flowables[led:]))]
    return story


def _headed(heading: Flowable, first: list[Flowable]) -> list[Flowable]:
    """A heading and what stands under it: together, but a long table goes on over the page where enough of it fits below the heading."""
    if not isinstance(first[-1], Table):
        return [KeepTogether([heading, *first])]
    height = sum(flowable.wrap(_WIDTH, A4[1])[1] for flowable in (heading, *first)) + 10 * mm
    return [CondPageBreak(min(height, _ENOUGH)), heading, *first]


def _runs(flowables: Iterable[Flowable]) -> list[Flowable]:
    """The same with pictures that follow each other as one that fills pages."""
    story: list[Flowable] = []
    for _, group in groupby(flowables, lambda f: isinstance(f, FittingPicture)):
        members = list(group)
        pictures = [f for f in members if isinstance(f, FittingPicture)]
        story += [PictureRun(pictures)] if pictures else members
    return story


def _flowables(block: doc.Block, placed: Placed) -> list[Flowable]:
    """A block, after its caption where it is a table that has one."""
    if isinstance(block, doc.Table) and block.caption:
        # With a page's end near the whole goes over; else the table begins here and goes on there, under its header again.
        return [
            CondPageBreak(0.5 * _ENOUGH),
            Paragraph(escape(block.caption), _style(9, colour=_QUIET, after=1)),
            _table(block),
        ]
    return [_flowable(block, placed)]


def _flowable(block: doc.Block, placed: Placed | None = None) -> Flowable:
    match block:
        case doc.Paragraph():
            return _paragraph(block)
        case doc.Notice():
            return _notice(block)
        case doc.Bullets():
            return _bullets(block)
        case doc.Table():
            return _table(block)
        case doc.Picture():
            return _picture(block, placed)
        case doc.Interactive():
            raise ValueError("only the HTML page shows what can be turned")


def _paragraph(block: doc.Paragraph) -> Flowable:
    size, colour = {"lead": (11, _INK), "small": (9, _QUIET)}.get(block.weight, (9.5, _INK))
    return Paragraph(escape(block.text), _style(size, colour=colour, after=1.5))


def _notice(block: doc.Notice) -> Flowable:
    lines = [Paragraph(escape(line), _style(10, bold=True)) for line in block.text.splitlines()]
    table = Table([[lines]], colWidths=[_WIDTH], spaceAfter=2 * mm)
    box = [("BOX", (0, 0), (-1, -1), 1.2, colors.HexColor("#b35900")), ("BACKGROUND", (0, 0), (-1, -1), "#fff4e5")]
    table.setStyle(TableStyle(box))
    return table


def _bullets(block: doc.Bullets) -> Flowable:
    items = [Paragraph(escape(text), _style(9, colour=_QUIET)) for text in block.items]
    return ListFlowable(items, bulletType="bullet", bulletFontSize=7, leftIndent=10, spaceAfter=2 * mm)


def _table(block: doc.Table) -> Flowable:
    align = [2 * right for right in block.right]
    cells = [
        [Paragraph(escape(c), _style(_CELL, align=a)) for c, a in zip(row, align, strict=True)] for row in block.rows
    ]
    lines = [("LINEBELOW", (0, 0), (-1, -1), 0.4, colors.HexColor("#c8cfd6")), ("VALIGN", (0, 0), (-1, -1), "TOP")]
    if any(block.header):
        heads = zip(block.header, align, strict=True)
        cells.insert(0, [Paragraph(escape(c), _style(_CELL, bold=True, align=a)) for c, a in heads])
    pads = [("TOPPADDING", (0, 0), (-1, -1), 1.5), ("BOTTOMPADDING", (0, 0), (-1, -1), 2)]
    table = Table(
        cells,
        colWidths=column_widths(block, _WIDTH, _BOLD, _CELL),
        repeatRows=int(any(block.header)),
        spaceAfter=2.5 * mm,
    )
    table.setStyle(TableStyle(lines + pads))
    return table


def _picture(block: doc.Picture, placed: Placed | None) -> Flowable:
    with PillowImage.open(block.path) as image:
        width, height = image.size
    shown = _WIDTH * block.width
    caption = Paragraph(escape(block.caption), _style(9, colour=_QUIET))
    return FittingPicture(str(block.path), shown, shown * height / width, caption, block.vector, placed)


def _decorate(document: doc.Document, canvas: Canvas, template: SimpleDocTemplate) -> None:
    canvas.saveState()
    canvas.setFont(_BOLD, 8)
    canvas.drawString(_MARGIN, 10 * mm, document.footer)
    canvas.setFont(_FONT, 8)
    canvas.drawRightString(A4[0] - _MARGIN, 10 * mm, f"page {template.page}")
    for notice in document.notices:
        canvas.drawString(_MARGIN, A4[1] - 12 * mm, notice.text[:110])
    canvas.restoreState()


def _style(
    size: float,
    bold: bool = False,
    colour: colors.Color = _INK,
    before: float = 0,
    after: float = 0,
    align: int = 0,
) -> ParagraphStyle:
    return ParagraphStyle(
        f"{size}{bold}{align}", fontName=_BOLD if bold else _FONT, fontSize=size, leading=1.35 * size, textColor=colour,
        spaceBefore=before * mm, spaceAfter=after * mm, alignment=align, splitLongWords=True, wordWrap="LTR",
    )  # fmt: skip


def _register_fonts() -> None:
    folder = Path(matplotlib.get_data_path(), "fonts", "ttf")
    for name in (_FONT, _BOLD):
        if name not in pdfmetrics.getRegisteredFontNames():
            pdfmetrics.registerFont(TTFont(name, str(folder / f"{name}.ttf")))
