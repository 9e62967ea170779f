"""Makes a moving figure of drawn keyframes: a solid from the first drawing, the stiffness and rim forces that take it through the others.

Drawings are PNG or SVG files of one figure, filled or as a closed line; parts in different colours may differ in stiffness. Writes
film.mp4, the film's pictures, keyframes.png and sketch.json. With --example it writes drawings to try instead.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.applications.sketch.sides import SIDES
from palpate.core.errors import InputError
from palpate.ui.cli.arguments import UsageError, no_points, random_seed, whole_number
from palpate.ui.cli.console import Console

if TYPE_CHECKING:
    from palpate.applications.sketch.sketch_options import SketchOptions
    from palpate.applications.sketch.sketch_summary import SketchRecord

NAME, HELP = "sketch", "drawn keyframes to a moving figure with a stiffness"
METHODS = ("gauss-newton", "swarm")
SUMMARY = "sketch.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """KEY1 KEY2 ... -o DIR, and how to read them."""
    parser.add_argument(
        "keys", nargs="*", type=Path, metavar="KEY", help="keyframes, the figure at rest first: PNG or SVG"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="folder to make")
    parser.add_argument(
        "--example", action="store_true", help="write keyframes of three letters to DIR, and nothing else"
    )
    group = parser.add_argument_group("the figure")
    group.add_argument(
        "--size", type=_positive, default=100.0, metavar="MM", help="its larger extent (default %(default)g)"
    )
    group.add_argument("--hold", metavar="SIDE[,SIDE]", help=f"what does not move: {', '.join(SIDES)}, or none "
                       "(default: the sides that all keyframes show in the same place)")  # fmt: skip
    group.add_argument(
        "--poisson", type=_poisson, default=0.4, metavar="NU", help="Poisson's ratio (default %(default)g)"
    )
    group.add_argument("--pull", type=_positive, metavar="N",
                       help="the total force on the figure in KEY2, N per mm of its thickness (default: unknown)")  # fmt: skip
    group = parser.add_argument_group("the search")
    group.add_argument("--method", choices=METHODS, default=METHODS[0],
                       help="swarm: the paper's, over the stiffness of the parts, beside Gauss-Newton (default %(default)s)")  # fmt: skip
    group.add_argument("--line-error", type=_positive, default=0.4, metavar="PERCENT",
                       help="how exact the lines are drawn, in per cent of the size (default %(default)g)")  # fmt: skip
    group.add_argument("--tets", type=whole_number(150, 20000), default=None, metavar="N",
                       help="tetrahedra to aim at (default: 600, of several colours 1500)")  # fmt: skip


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Sketches; see `run_sketch`."""
    no_points(args)
    _check_folder(args.output)
    if args.example:
        return _example(args)
    if not 2 <= len(args.keys) <= 6:
        raise UsageError("give two to six keyframes: palpate sketch KEY1 KEY2 KEY3 -o DIR")
    from palpate.applications.sketch.pictures.frames import write_sketch
    from palpate.applications.sketch.run_sketch import run_sketch  # here, because VTK takes seconds to load

    with console.progress(NAME) as progress:
        sketch = run_sketch(args.keys, _options(args), lambda f, m: progress(0.9 * f, m))
        progress(0.9, "film")
        summary = write_sketch(sketch, args.output)
    return summary, "\n".join(text_of(summary, args.output))


def text_of(summary: SketchRecord, folder: Path) -> list[str]:
    """What a person reads of a sketch."""
    lines = [f"note    {note}" for note in summary["notes"]]
    lines += [
        f"frame   keyframe {k}: {f['rms_percent']:.2f} % of the size off (rms), {f['hausdorff_percent']:.2f} % at most"
        for k, f in enumerate(summary["keyframes"], start=2)
    ]
    lines += [f"says    {words}" for words in summary["in_words"]]
    return [*lines, f"film    {folder / 'film.mp4'}", f"picture {folder / 'keyframes.png'}"]


def _options(args: argparse.Namespace) -> SketchOptions:
    from palpate.applications.sketch.sketch_options import SketchOptions  # here, because numba takes a second to load
    from palpate.applications.sketch.swarm_fit import SwarmFitOptions

    hold = None
    if args.hold is not None:
        hold = tuple(side for side in args.hold.split(",") if side != "none")
        unknown = [side for side in hold if side not in SIDES]
        if unknown:
            raise UsageError(
                f"--hold {args.hold}: there is no side {unknown[0]!r}; choose from {', '.join(SIDES)}, none"
            )
    swarm = SwarmFitOptions(seed=random_seed(args)) if args.method == "swarm" else None
    return SketchOptions(
        args.size, hold, args.poisson, args.line_error / 100.0, args.tets, pull_n_per_mm=args.pull, swarm=swarm
    )


def _example(args: argparse.Namespace) -> tuple[Mapping[str, object], str]:
    from palpate.applications.sketch.pictures.example import write_example

    if args.keys:
        raise UsageError("--example takes no keyframes: palpate sketch --example -o DIR")
    files = write_example(args.output)
    letter = files[:3]
    command = f"palpate sketch {' '.join(map(str, letter))} -o {args.output.name}_film"
    return {"files": [str(file) for file in files]}, "\n".join(
        [*(f"drawing {file}" for file in files), f"next    {command}"]
    )


def _check_folder(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; choose a new folder with -o")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / SUMMARY).exists():
        raise InputError(f"{folder} is not empty and contains no sketch; choose a new folder with -o")


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from error
    if not 0.0 < value < 1e6:
        raise argparse.ArgumentTypeError(f"{text} is out of range; give a positive number")
    return value


def _poisson(text: str) -> float:
    value = _positive(text)
    if not value <= 0.48:
        raise argparse.ArgumentTypeError(f"{text} is out of range; give 0 to 0.48")
    return value
