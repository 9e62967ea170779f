"""What a report says, before it is a page: the same for HTML and PDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

RESEARCH_USE = "Research use only \N{EN DASH} not for diagnosis"


@dataclass(frozen=True)
class Paragraph:
    """Plain text. weight : "normal", "lead" for what must be read first, "small" for notes."""

    text: str
    weight: str = "normal"


@dataclass(frozen=True)
class Notice:
    """A boxed text that must not be overlooked."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list of plain texts."""

    items: Sequence[str]


@dataclass(frozen=True)
class Table:
    """header and rows of plain text; columns of figures are aligned right where ``numbers``."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    numbers: bool = True

    @property
    def right(self) -> tuple[bool, ...]:
        """Whether each column is aligned right: all that stands in it begins like a number."""
        columns = zip(*self.rows, strict=True) if self.rows else ((),) * len(self.header)
        return tuple(self.numbers and all(_is_figure(cell) for cell in column) for column in columns)


def _is_figure(cell: str) -> bool:
    return not cell or cell[0] in "0123456789+-\N{MINUS SIGN}\N{EN DASH}"


@dataclass(frozen=True)
class Picture:
    """A PNG file with a caption; ``says`` tells a person who cannot see it what it shows. width : share of the page's.

    vector : the same figure as a PDF page, for the PDF report; empty where it is pixels only.
    """

    path: Path
    caption: str
    says: str
    width: float = 1.0
    vector: bytes = b""


@dataclass(frozen=True)
class Interactive:
    """An HTML fragment that a reader can turn and play, made by us and not from a case's texts. Only the HTML page shows it."""

    html: str
    caption: str


Block = Paragraph | Notice | Bullets | Table | Picture | Interactive


@dataclass(frozen=True)
class Section:
    """A heading and what stands under it."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Document:
    """title, subtitle : of the first page. notices : boxed, above everything else. footer : on every page."""

    title: str
    subtitle: str
    sections: Sequence[Section]
    notices: Sequence[Notice] = field(default=())
    footer: str = RESEARCH_USE


def numbered(document: Document) -> Document:
    """The same with figures counted from 1, in page and PDF alike: a view that turns, which only the page has, is not counted."""
    sections, count = [], 0
    for section in document.sections:
        blocks: list[Block] = []
        for block in section.blocks:
            if isinstance(block, Picture):
                count += 1
                block = replace(block, caption=f"Figure {count}. {block.caption}")
            blocks.append(block)
        sections.append(replace(section, blocks=blocks))
    return replace(document, sections=sections)
