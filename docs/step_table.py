"""Write the table of steps in docs/case.md from the steps' declarations: `python docs/step_table.py`."""

from __future__ import annotations

from pathlib import Path

from palpate.case.steps.declarations import STEPS
from palpate.case.steps.step import Step
from palpate.ui.report.declaration import REPORT

PAGE = Path(__file__).with_name("case.md")
BEGIN, END = "<!-- steps: written by docs/step_table.py -->", "<!-- end of steps -->"


def table() -> str:
    """The steps as a table: name, what it does, what it reads, what it writes."""
    rows = ["| step | does | reads | writes |", "| --- | --- | --- | --- |"]
    rows += [f"| `{step.name}` | {step.title} | {_reads(step)} | {_files(step.writes)} |" for step in (*STEPS, REPORT)]
    return "\n".join(rows)


def page(text: str) -> str:
    """The page with the table between its two marks."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{table()}\n\n{END}{after}"


def _reads(step: Step) -> str:
    return "; ".join(part for part in (_files(step.reads), step.reads_also) if part)


def _files(names: tuple[str, ...]) -> str:
    return ", ".join(f"`{name}`" for name in names)


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
