"""CSV tables with named columns: every cell is used or refused."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from palpate.core.errors import InputError
from palpate.core.files.nearest_name import nearest

_REMEDY = "save it again as CSV in UTF-8"


@dataclass(frozen=True)
class Row:
    """line : of the file, from 1. cells : column -> text without blanks around it, "" where the row ends before."""

    line: int
    cells: dict[str, str]


def read_csv_table(path: Path, needed: Sequence[str], optional: Collection[str] = ()) -> list[Row]:
    """Rows of a table whose first line names its columns, separated by commas, or by tabs where that line holds one.

    Rows without any text are left out. Raises InputError naming the file, and the line, for a column that is missing,
    unknown or there twice, and for a cell without a column.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        tabs = "\t" in text.partition("\n")[0]
        table = csv.reader(io.StringIO(text, newline=""), dialect="excel-tab" if tabs else "excel")
        rows = [(table.line_num, [cell.strip() for cell in cells]) for cells in table]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} is not a readable CSV table; {_REMEDY}") from error
    filled = [(line, cells) for line, cells in rows if any(cells)]
    header = filled[0][1] if filled else []
    _check_header(path, header, needed, optional)
    return [Row(line, _cells(path, line, cells, header)) for line, cells in filled[1:]]


def _check_header(path: Path, header: Sequence[str], needed: Sequence[str], optional: Collection[str]) -> None:
    known = [*needed, *optional]
    for name in needed:
        if name not in header:
            raise InputError(f"{path} lacks the column {name}; its first line must name {','.join(needed)}")
    for name in header:
        if name and name not in known:
            raise InputError(f"{path} has an unknown column {name!r}; {nearest(name, known)}")
        if name and header.count(name) > 1:
            raise InputError(f"{path} has the column {name!r} twice; keep one of them")


def _cells(path: Path, line: int, cells: Sequence[str], header: Sequence[str]) -> dict[str, str]:
    loose = [text for at, text in enumerate(cells) if text and not (at < len(header) and header[at])]
    if loose:
        raise InputError(
            f"{path} line {line} has {len(cells)} cells under {sum(map(bool, header))} columns, {loose[0]!r} under none: give it "
            "a column, or put a cell that holds a comma into quotation marks"
        )
    return {name: cells[at] if at < len(cells) else "" for at, name in enumerate(header) if name}
