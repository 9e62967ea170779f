"""The whole way on the simulated sample pair that comes with the program, as `analyze` does it on scans of your own."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from palpate.ui.cli.commands import analyze, identify, import_scans, mesh, segment
from palpate.ui.cli.console import Console

NAME, HELP = "demo", "the whole way on the sample pair"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """[-o CASE] and the options of the steps after the import."""
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("demo_case"),
        metavar="CASE",
        help="case folder to make (default %(default)s)",
    )
    segment.add_options(parser)
    mesh.add_options(parser)
    identify.add_options(parser)
    analyze.add_own_options(parser)


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Runs every step; see `analyze`. Raises InputError where the sample pair is absent."""
    from palpate.case.sample.scans import sample_scans  # here, as all that takes long to load: help comes at once

    usual = argparse.ArgumentParser()
    import_scans.add_arguments(usual, alone=False)
    pair = usual.parse_args([*map(str, sample_scans()), "-o", str(args.output)])
    return analyze.run(argparse.Namespace(**{**vars(pair), **vars(args)}), console)
