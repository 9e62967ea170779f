"""Write docs/measured.md, and the tables of gap.md and validation.md, from docs/measured.toml: `python docs/write_measured.py`."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

DOCS = Path(__file__).parent
DEFAULT_PAGE = "measured.md"
BEGIN, END = "<!-- figures: written by docs/write_measured.py -->", "<!-- end of figures -->"


@dataclass(frozen=True, kw_only=True)
class Run:
    """Figures of one command. commit : abbreviated hash of the program that was measured. rows : a name, then one figure a cell."""

    command: str
    date: date
    commit: str
    rows: list[list[str]]
    header: Sequence[str] = ("what", "found")

    def table(self) -> str:
        """The command over its table. Raises ValueError for a row of another width than the header."""
        if any(len(row) != len(self.header) for row in self.rows):
            raise ValueError(f"a row of `{self.command}` is not as wide as its header")
        return f"`{self.command}` ({self.date.isoformat()}, `{self.commit}`)\n\n{_table([self.header, *self.rows])}"


def _table(rows: Sequence[Sequence[str]]) -> str:
    head, *others = rows
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *others))


@dataclass(frozen=True, kw_only=True)
class Study:
    """One run of a study that was made several times: a column of a table. found : by what was measured, in the table's order."""

    title: str
    command: str
    date: date
    commit: str
    found: dict[str, str]


def side_by_side(studies: Sequence[Study]) -> str:
    """Table with a row for each thing measured and a column for each study. Raises ValueError when they did not measure the same."""
    measured = list(studies[0].found)
    if any(list(study.found) != measured for study in studies):
        raise ValueError(f"studies measured other things than {studies[0].title}: {', '.join(measured)}")
    rows = [["what", *(study.title for study in studies), "together"]]
    for what in measured:
        found = [study.found[what] for study in studies]
        rows.append([what, *found, together(found)])
    runs = [f"- {s.title}: `{s.command}` ({s.date.isoformat()}, `{s.commit}`)" for s in studies]
    return "\n".join([_table(rows), "", *runs])


def together(found: Sequence[str]) -> str:
    """Sum of counts that begin as "3 of 4"; empty where one does not."""
    counts = [re.match(r"(\d+) of (\d+)\b", one) for one in found]
    if not all(counts):
        return ""
    hits, cases = (sum(int(count[k]) for count in counts if count) for k in (1, 2))
    return f"{hits} of {cases}"


@dataclass(frozen=True, kw_only=True)
class Section:
    """Figures under the same conditions. page : page of docs/ that holds their tables. note : the conditions.

    studies : runs of one study, whose figures stand side by side above the others.
    """

    id: str
    title: str
    note: str
    runs: tuple[Run, ...]
    page: str = DEFAULT_PAGE
    studies: tuple[Study, ...] = ()

    def tables(self) -> str:
        """Conditions and tables, without the heading."""
        parts = [self.note, side_by_side(self.studies) if self.studies else "", *(run.table() for run in self.runs)]
        return "\n\n".join(part for part in parts if part)


def sections(path: Path = DOCS / "measured.toml") -> list[Section]:
    """Sections of the file of figures. Raises TypeError for a key that is missing or unknown."""
    stated = tomllib.loads(path.read_text(encoding="utf-8"))["section"]
    return [
        Section(
            runs=tuple(Run(**f) for f in one.pop("run", [])),
            studies=tuple(Study(**f) for f in one.pop("study", [])),
            **one,
        )
        for one in stated
    ]


def written() -> dict[str, str]:
    """Text by page, each with its tables between the two marks."""
    parts: dict[str, list[str]] = {}
    for one in sections():
        own_page = one.page != DEFAULT_PAGE
        parts.setdefault(one.page, []).append(one.tables() if own_page else f"## {one.title}\n\n{one.tables()}")
        if own_page:
            parts.setdefault(DEFAULT_PAGE, []).append(f"## {one.title}\n\nSee [the page on it]({one.page}#figures).")
    return {page: between_marks((DOCS / page).read_text(encoding="utf-8"), "\n\n".join(p)) for page, p in parts.items()}


def between_marks(text: str, table: str) -> str:
    """The page's text with the table between its marks. Raises ValueError where it has none."""
    before, _, rest = text.partition(BEGIN)
    _, mark, after = rest.partition(END)
    if not mark:
        raise ValueError(f"a page has no marks {BEGIN} and {END}")
    return f"{before}{BEGIN}\n\n{table}\n\n{END}{after}"


if __name__ == "__main__":
    for page, text in written().items():
        (DOCS / page).write_text(text, encoding="utf-8")
