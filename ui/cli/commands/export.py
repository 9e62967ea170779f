"""Writes the results of a case for another program."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from palpate.core.errors import InputError
from palpate.ui.cli.arguments import add_case, case_of
from palpate.ui.cli.console import Console
from palpate.ui.export import export, exporter, names

NAME, HELP = "export", "results for other programs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """CASE --to FORM [--tissue] DIR."""
    add_case(parser)
    parser.add_argument("--to", required=True, choices=names(), help="form to write")
    parser.add_argument("--tissue", action="store_true", help="keep the surrounding tissue among the labels")
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder to write into")


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Exports; see `palpate.ui.export`."""
    case = case_of(args)
    if args.folder.exists() and not args.folder.is_dir():
        raise InputError(f"{args.folder} is a file; give a folder to write into")
    with console.progress(NAME) as progress:
        progress(0.0, exporter(args.to).WRITES)
        files = export(args.to, case, args.folder, args.tissue)
        progress(1.0, "written")
    return {"files": [str(path) for path in files]}, "\n".join(f"written {path}" for path in files)
