"""Studies that put figures on what is claimed.

robustness: does every particle end in a stable equilibrium, or in a reason? Random scenes and stiffnesses, one by one.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from palpate.core.worker.progress import Progress
from palpate.segmentation.atomic import atomic_path
from palpate.ui.cli.arguments import no_points, random_seed, whole_number
from palpate.ui.cli.console import Console

NAME, HELP = "validate", "studies of what is claimed, as JSON"
_Study = Callable[[argparse.Namespace, Progress], dict[str, Any]]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """STUDY, and how large."""
    parser.add_argument("study", choices=tuple(STUDIES), metavar="STUDY", help=", ".join(STUDIES))
    parser.add_argument("--scenes", type=whole_number(1, 1_000_000), default=1000, metavar="N",
                        help="how many random scenes (default %(default)s)")  # fmt: skip
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the figures to this JSON file too")


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Runs one study."""
    from palpate.core.worker.messages import encode

    no_points(args)
    with console.progress(args.study) as progress:
        found = STUDIES[args.study](args, progress)
    if args.output is not None:
        with atomic_path(args.output) as path:
            path.write_text(encode(found) + "\n", encoding="utf-8")
    return found, "\n".join(f"{key}: {value}" for key, value in found.items() if not isinstance(value, list))


def _robustness(args: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from palpate.core.validate.robustness import RobustnessOptions, robustness

    return robustness(RobustnessOptions(args.scenes, random_seed(args, 0)), progress)


STUDIES: dict[str, _Study] = {"robustness": _robustness}
