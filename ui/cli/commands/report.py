"""Writes the report of an identified case: one HTML page, a PDF and the pictures in them."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from palpate.ui.cli.arguments import add_case, case_of
from palpate.ui.cli.console import Console

if TYPE_CHECKING:
    from palpate.ui.report.report_step import Written

NAME, HELP = "report", "pictures, HTML page and PDF of an identified case"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """CASE."""
    add_case(parser)


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Reports; see `report_step.run`."""
    case = case_of(args)
    from palpate.ui.report import report_step

    with console.progress(NAME) as progress:
        written = report_step.run(case, None, progress)
    return written, "\n".join(text_of(written))


def text_of(written: Written) -> list[str]:
    """Where the report is, and what is not in it."""
    lines = [f"report  {written['html']}", f"report  {written['pdf']}"]
    return lines + [f"missing {what}" for what in written["missing"]]
