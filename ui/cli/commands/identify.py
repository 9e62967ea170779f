"""Finds the stiffness that explains the deformed scan, in a worker process, and says how sure it is."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.ui.cli.arguments import IMAGE_HELP, add_case, case_of, random_seed, whole_number, workers
from palpate.ui.cli.console import Console
from palpate.ui.cli.steps import recorded
from palpate.ui.words.number_words import three_figures

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder
    from palpate.core.identify.options import IdentifyOptions
    from palpate.core.identify.result_record import ReidentificationRecord, ResultRecord

NAME, HELP = "identify", "mesh and surfaces to stiffness with its uncertainty"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """CASE, and how to search."""
    add_case(parser)
    parser.add_argument("--again", type=Path, metavar="LABELS",
                        help="only the organ's contours on the deformed scan are new: labels drawn on it. Answers in a second from "
                        "the model that the case's last swarm left; writes again.json, result.json stays")  # fmt: skip
    parser.add_argument("--repeat", type=_repeat, action="append", default=[], metavar="STATE=LABELS",
                        help="labels drawn a second time on a scan, STATE rest or deformed: the contours' error is measured from "
                        "them where case.json states none")  # fmt: skip
    add_options(parser)


def add_options(parser: argparse.ArgumentParser) -> None:
    """How to search."""
    from palpate.core.fem.elements import ELEMENTS  # here: not every command loads it
    from palpate.core.identify.options import BOUNDARIES, METHODS
    from palpate.core.identify.options import IdentifyOptions as default

    group = parser.add_argument_group("identification")
    group.add_argument("--method", choices=METHODS, default=default.method, help="search (default %(default)s)")
    group.add_argument("--boundary", choices=BOUNDARIES, default=default.boundary,
                       help="how the organ is supported and driven (default %(default)s)")  # fmt: skip
    group.add_argument("--element", choices=tuple(ELEMENTS), default=default.element,
                       help="of the forward model; p1 is the paper's, which locks (default %(default)s)")  # fmt: skip
    group.add_argument("--particles", type=whole_number(4, 1000), default=default.particles, metavar="N",
                       help="of the swarm (default %(default)s)")  # fmt: skip
    group.add_argument("--iterations", type=whole_number(1, 10000), default=default.iterations, metavar="N",
                       help="of the swarm, at most (default %(default)s)")  # fmt: skip
    group.add_argument("--no-map", dest="stiffness_map", action="store_false",
                       help="regional values only, no map of the stiffness within the organ")  # fmt: skip
    group.add_argument("--uneven", action="store_true",
                       help="do not take a region for uniform: what a focus within it does at the surface counts as an error, which "
                       "keeps it out of the other regions' values and widens the intervals")  # fmt: skip
    group.add_argument("--image", action=argparse.BooleanOptionalAction, default=default.image,
                       help=IMAGE_HELP)  # fmt: skip
    group.add_argument("--law", default=default.law, metavar="NAME",
                       help="the organ's strain energy: neo-hookean, or a file of your own in core/laws (default %(default)s)")  # fmt: skip
    group.add_argument("--split-mu", action="store_true",
                       help="look for mu1 and mu2 of every region apart, and say whether this pair separates them")  # fmt: skip


def options_of(args: argparse.Namespace) -> IdentifyOptions:
    """The identification options of a command line."""
    from palpate.core.identify.options import IdentifyOptions

    return IdentifyOptions(
        method=args.method,
        boundary=args.boundary,
        element=args.element,
        particles=args.particles,
        iterations=args.iterations,
        seed=random_seed(args),
        workers=workers(args),
        stiffness_map=args.stiffness_map,
        split_mu=args.split_mu,
        uneven=args.uneven,
        image=args.image,
        law=args.law,
    )


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Identifies; see `identify_step.run` and `again_step.run`."""
    case = case_of(args)
    from palpate.case.steps import identify, measure_contour_noise, reidentify
    from palpate.core.files.json_types import plain

    if args.again is not None:
        with recorded(case, args), console.progress(NAME) as progress:
            again = reidentify.run(case, args.again, progress)
        return plain(again), "\n".join(text_of(case, again, "again.json"))
    if args.repeat:
        measure_contour_noise.run(case, dict(args.repeat))
    with recorded(case, args), console.progress(NAME) as progress:
        result = identify.run(case, options_of(args), progress)
    return plain(result), "\n".join(text_of(case, result))


def _repeat(text: str) -> tuple[str, Path]:
    from palpate.case.case_folder import STATES

    state, equals, path = text.partition("=")
    if not (equals and path) or state not in STATES:
        raise argparse.ArgumentTypeError(f"{text!r} is not like rest=second_drawing.nii.gz or deformed=...")
    return state, Path(path)


def text_of(case: CaseFolder, result: ResultRecord | ReidentificationRecord, written: str = "result.json") -> list[str]:
    """What a person reads of an identification."""
    from msgspec import UNSET

    from palpate.case.meshed import rigid_offset_of
    from palpate.core.files.json_types import known
    from palpate.core.identify.result_record import ResultRecord

    missing = result.missing if isinstance(result, ResultRecord) else UNSET
    lines = [f"missing {line}" for line in missing or []]
    for name, found in result.parameters.items():
        ci = found.ci95_kpa
        sure = "error not known" if ci is None else f"95 % interval {three_figures(ci[0])} to {three_figures(ci[1])}"
        edge = ", at the edge of what was allowed" if found.at_bound else ""
        lines.append(f"found   {name}: G = {three_figures(found.G_kpa)} kPa, {sure}{edge}")
    lines.append(f"misfit  {result.misfit.rms_mm:.2f} mm rms")
    searches = result.agreement if isinstance(result, ResultRecord) else UNSET
    if searches and not searches.harmless:
        lines.append(f"doubt   {searches.in_words}")
    if isinstance(result, ResultRecord) and result.contour_errors_mm:
        sd = known(result.misfit.contour_noise_sd_mm)
        lines.append(
            "noise   the prostate's contours are one, carried over by the images"
            if sd is None
            else f"noise   {sd:.2f} mm of the prostate's contours, estimated from the images"
        )
    elif case.has("noise.json"):
        lines.append(f"noise   {case.read_json('noise.json')['sd_mm']:.2f} mm, from contours drawn twice")
    lines += [f"says    {part}" for part in result.identifiability.verdict.split("; ")]
    elsewhere = rigid_offset_of(case) if case.has("mesh.json") else None
    lines += [] if elsewhere is None else [f"note    {elsewhere.words()}"]
    return [*lines, f"result  {case.file(written)}"]
