"""Lets an identified organ fall onto a dish and writes a film of it; two cases side by side show how their stiffness differs.

The organ moves with its identified stiffness, its mass, damping, contact and friction. Organs are called A and B in the film. See
docs/drop.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.core.errors import InputError
from palpate.imaging.labels import LABELS
from palpate.ui.cli.arguments import no_points, number
from palpate.ui.cli.console import Console
from palpate.ui.words.number_words import three_figures

if TYPE_CHECKING:
    from palpate.applications.dynamics.drop import DropFigures

    class OrganFall(DropFigures):
        """One organ of the film: its name there and the stiffness it fell with."""

        name: str
        G_kpa: dict[str, float]


NAME, HELP = "drop", "a film of the organ, or of two, falling onto a dish"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """CASE [CASE2], the film, and how it falls."""
    parser.add_argument("cases", type=Path, nargs="+", metavar="CASE", help="one identified case folder, or two")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE.mp4", help="the film")
    parser.add_argument("--height", type=number(1.0, 500.0), default=30.0, metavar="MM",
                        help="that it falls until it touches the dish (default %(default)g)")  # fmt: skip
    parser.add_argument("--time", type=number(0.02, 5.0), default=0.5, metavar="S",
                        help="seconds of motion (default %(default)g)")  # fmt: skip
    parser.add_argument("--slower", type=number(1.0, 100.0), default=8.0, metavar="TIMES",
                        help="how many times slower than real the film runs (default %(default)g)")  # fmt: skip
    parser.add_argument("--damping", type=number(0.0, 100.0), default=1.0, metavar="MS",
                        help="relaxation time of the tissue's viscosity (default %(default)g ms; 0 for none)")  # fmt: skip
    parser.add_argument("--friction", type=number(0.0, 2.0), default=0.2, metavar="MU",
                        help="Coulomb's coefficient on the dish (default %(default)g)")  # fmt: skip
    parser.add_argument("--element", choices=("p1p1", "p2p0", "p2p1"), default="p1p1",
                        help="quadratic ones take several times as long (default %(default)s)")  # fmt: skip


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Simulates, then draws; the film appears whole or not at all."""
    from palpate.applications.drop.fallen import PER_SECOND, film_of
    from palpate.applications.dynamics.drop import DropOptions
    from palpate.case.case_folder import CaseFolder, check_beside_scans  # here, because all these take seconds to load

    no_points(args)
    if len(args.cases) > 2:
        raise InputError(f"{args.cases[2]}: a film shows one case or two; leave the others out")
    if args.output.suffix.lower() != ".mp4" or args.output.is_dir():
        raise InputError(f"{args.output}: a film is a file whose name ends in .mp4; change -o")
    options = DropOptions(height=args.height, seconds=args.time, frames=PER_SECOND * args.slower)
    options = replace(options, damping=1e-3 * args.damping, friction=args.friction, element=args.element)
    cases = [CaseFolder(path) for path in args.cases]
    for case in cases:
        check_beside_scans(case, args.output)
    with console.progress(NAME) as progress:
        fallen = film_of(cases, options, args.output, progress)
    dropped = fallen.dropped
    organs: list[OrganFall] = [
        {"name": organ.name, "G_kpa": {LABELS[r]: G for r, G in organ.stiffness_kpa.items()}, **one.figures}
        for organ, one in zip(dropped.organs, dropped.drops, strict=True)
    ]
    pictures = len(dropped.drops[0].times)
    found = {
        "film": str(args.output),
        "codec": fallen.codec,
        "pictures": pictures,
        "organs": organs,
        "research_use": True,
    }
    return found, "\n".join([*map(_line, organs), f"film {args.output}"])


def _line(organ: OrganFall) -> str:
    stiffness = ", ".join(f"{name.replace('_', ' ')} {three_figures(G)} kPa" for name, G in organ["G_kpa"].items())
    if not organ["landed"]:
        return f"organ {organ['name']} ({stiffness}): still falling at the end; give it more --time"
    when, speed, back = organ["fall_time_s"], organ["impact_speed_mm_s"], organ["rebound_mm"]
    assert when is not None and speed is not None and back is not None  # it has landed
    return (
        f"organ {organ['name']} ({stiffness}): on the dish after {1e3 * when:.0f} ms at "
        f"{1e-3 * speed:.2f} m/s, flattened to {100 * organ['flattest']:.0f} % of its height, "
        f"back up by {back:.1f} mm; deepest penetration {organ['deepest_penetration_mm']:.3f} mm, "
        f"energy never grew by more than {100 * organ['energy_growth']:.2f} %; {organ['seconds']:.0f} s"
    )
