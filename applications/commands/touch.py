"""Feels the organ of a case: its identified stiffness under a rigid spherical probe, pressed and pulled with the mouse in a window.

Force in newton and indentation in millimetres are shown as one works; the curve is saved as CSV and picture. The organ is touched alone:
--support says what holds it. `--headless --script FILE` does what a script says, without a screen; docs/touch.md lists its commands.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.ui.cli.arguments import UsageError, add_case, no_points, whole_number
from palpate.ui.cli.console import Console

if TYPE_CHECKING:
    from palpate.applications.touch.body import Body
    from palpate.applications.touch.window.touch_application import Touched
    from palpate.applications.touch.window.touch_script import TouchEvent
    from palpate.case.case_folder import CaseFolder
    from palpate.ui.desktop.scripting.script_runner import Command

NAME, HELP = "touch", "press and pull the organ in a window and feel its stiffness"
_SUPPORTS = ("bed", "table")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """CASE, the probe, what holds the organ, and how to do without hands."""
    add_case(parser)
    parser.add_argument("--radius", type=_radius, default=8.0, metavar="MM", help="of the probe (default %(default)s)")
    parser.add_argument(
        "--support", choices=_SUPPORTS, default="bed",
        help="bed: springs all over the surface, as soft as the tissue that was taken away (default); table: the back is held fast",
    )  # fmt: skip
    parser.add_argument("--tets", type=whole_number(500, 20_000), default=4000, metavar="N",
                        help="about how many tetrahedra the organ is made of (default %(default)s)")  # fmt: skip
    parser.add_argument("--headless", action="store_true", help="without a screen; needs --script")
    parser.add_argument(
        "--script", type=Path, metavar="FILE", help="what to do, one command a line, instead of waiting for a person"
    )
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER",
                        help="where the window saves curves (default: the folder touch of the case)")  # fmt: skip


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Makes the organ ready; then plays the script, or opens the window."""
    from palpate.applications.touch.case_body import TouchStepOptions, body_of
    from palpate.applications.touch.window.touch_script import OF_THE_WINDOW, parse
    from palpate.case.case_folder import CaseFolder, check_beside_scans  # here, because it and VTK take seconds to load
    from palpate.ui.desktop.scripting.script_runner import read_script

    no_points(args)
    if args.headless and args.script is None:
        raise UsageError("--headless needs --script FILE: without a screen nobody can move the mouse")
    commands = [] if args.script is None else parse(read_script(args.script), str(args.script))
    seen = not args.headless or any(command.name in OF_THE_WINDOW for command in commands)
    if seen:
        from palpate.ui.desktop.window import display_server

        display_server.check(args.headless)
    case = CaseFolder(args.case)
    if args.output is not None:
        check_beside_scans(case, args.output)
    with console.progress(NAME) as progress:
        body = body_of(case, TouchStepOptions(args.tets, args.support), progress)
        progress(1.0, "organ ready")
    found = _in_window(args, case, body, commands) if seen else _by_hand(args, body, commands)
    about = {"support": args.support, "cells": len(body.mesh.cells), "surface_nodes": len(body.surface.nodes),
             "G_kpa": {body.names[r]: G for r, G in body.shear_kpa.items()}}  # fmt: skip
    files = [file for event in found["events"] for file in event.get("files", [])]
    return {**about, **found, "files": files}, "\n".join(map(_line, found["events"]))


def _by_hand(args: argparse.Namespace, body: Body, commands: list[Command]) -> Touched:
    """Without a window."""
    from palpate.applications.touch.window.protocol import ProbeControl
    from palpate.applications.touch.window.touch_script import Driver
    from palpate.ui.desktop.scripting.script_runner import play

    driver = Driver(ProbeControl(body, args.radius), args.script.absolute().parent, str(args.script))
    return {"events": play(commands, driver)}


def _in_window(args: argparse.Namespace, case: CaseFolder, body: Body, commands: list[Command]) -> Touched:
    from palpate.applications.touch.window import touch_application as application
    from palpate.ui.pictures.colours import STIFFNESS_SCALE

    folder = Path() if args.script is None else args.script.absolute().parent
    output = args.output or case.file("touch")
    probed = application.Probed(body, args.radius, STIFFNESS_SCALE)
    return application.show(probed, output, args.headless, application.Playing(commands, folder, str(args.script)))


def _line(event: TouchEvent) -> str:
    felt, slope = "", event.get("stiffness_n_per_mm")
    if event.get("region") is not None:
        felt = f"{event['region']:16} {event['indentation_mm']:6.2f} mm {event['force_n']:8.3f} N"
        felt += "" if slope is None else f" {slope:7.3f} N/mm"
    files = [*event.get("files", []), *([event["file"]] if "file" in event else [])]
    return f"{event['line']:4} {event['command']:10} {felt} {' '.join(files)}".rstrip()


def _radius(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not (math.isfinite(value) and 0.5 <= value <= 50.0):
        raise argparse.ArgumentTypeError(f"{text} is out of range; give 0.5 to 50")
    return value
