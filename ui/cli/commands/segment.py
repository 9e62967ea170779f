"""Finds body, bone, bladder, rectum and prostate in both scans of a case and writes them as label volumes.

What a person drew always wins. Organs that nobody drew or pointed at in one scan are carried over from the other.
Where the CT alone does not tell, point at an organ: --seed prostate=x,y,z (a click in
the scan at rest, patient coordinates LPS in mm), --extremes (its six outermost points) or --box (two corners).
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from palpate.core.errors import InputError
from palpate.ui.cli.arguments import UsageError, add_case, has_case, points, random_seed, workers
from palpate.ui.cli.console import Console
from palpate.ui.cli.steps import recorded
from palpate.ui.words.label_words import WORDS

if TYPE_CHECKING:
    from palpate.case.step_records import OrganRecord, SegmentationRecord, SegmentedRecord
    from palpate.segmentation.prompts import Prompts

NAME, HELP = "segment", "CTs to label volumes: prostate, bladder, rectum, bone, tissue"
_SIX = "NAME=X,Y,Z;...;X,Y,Z"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """CASE, and what a person points at."""
    add_case(parser)
    add_options(parser)


def add_options(parser: argparse.ArgumentParser) -> None:
    """What a person points at, beside --seed."""
    group = parser.add_argument_group("pointing at organs (patient coordinates, LPS mm)")
    group.add_argument(
        "--extremes", action="append", default=[], metavar=_SIX, help="six outermost points, scan at rest"
    )
    group.add_argument(
        "--box", action="append", default=[], metavar="NAME=X,Y,Z;X,Y,Z", help="two corners, scan at rest"
    )
    group.add_argument("--deformed-seed", action="append", default=[], metavar="NAME=X,Y,Z",
                       help="a click in the deformed scan, in its own coordinates")  # fmt: skip
    group.add_argument("--deformed-extremes", action="append", default=[], metavar=_SIX, help="likewise")
    group.add_argument("--deformed-box", action="append", default=[], metavar="NAME=X,Y,Z;X,Y,Z", help="likewise")
    parser.add_argument("--model", metavar="NAME", help="a learned model that you have installed, for what nobody drew or "
                        "pointed at: totalsegmentator, or monai:FOLDER (a MONAI bundle with models/model.ts)")  # fmt: skip
    parser.add_argument("--no-propagation", action="store_true", help="segment each scan by itself; usually organs that nobody "
                        "drew or pointed at in one scan are carried over from the other by the motion that both CTs show")  # fmt: skip


def prompts_of(args: argparse.Namespace) -> tuple[Prompts, Prompts]:
    """What was pointed at in the scan at rest and in the deformed one. Raises UsageError for a malformed point."""
    from palpate.segmentation.prompts import parse_prompts

    random_seed(args)  # a word without "=" is neither a number nor a point
    try:
        rest = parse_prompts(points(args), args.extremes, args.box)
        deformed = parse_prompts(args.deformed_seed, args.deformed_extremes, args.deformed_box, "--deformed-seed")
    except InputError as error:
        raise UsageError(str(error)) from error
    return rest, deformed


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Segments; see `run_segment`."""
    prompts = prompts_of(args)
    has_case(args)
    from palpate.case.case_folder import CaseFolder  # here, because these take seconds to load
    from palpate.case.steps.segment import run_segment
    from palpate.case.steps.segment_options import SegmentOptions

    options = SegmentOptions(*prompts, model=args.model, propagate=not args.no_propagation)
    case = CaseFolder(args.case)
    with recorded(case, args), console.progress(NAME) as progress:
        report = run_segment(case, options, progress, workers(args))
    return report, "\n".join(text_of(report))


def _origin(organ: OrganRecord) -> str:
    words = WORDS.get(organ["method"], organ["method"])
    return words if organ["method"] == "user" else f"{words}, confidence {organ['confidence']:.2f}"


def text_of(report: SegmentationRecord) -> list[str]:
    """What a person reads of a segmentation."""
    lines = []
    for state, facts in report["states"].items():
        organs = facts.get("organs", {})
        found = [f"{name} {_written_cc(name, o, facts):.1f} cc ({_origin(o)})" for name, o in organs.items()]
        lines.append(f"labels  {state}: {', '.join(found) or facts.get('source', 'given')}")
        bones = [f"{name.replace('_', ' ')} {b['confidence']:.2f}" for name, b in facts.get("bones", {}).items()]
        lines += [f"bones   {state}: identified with confidence: {', '.join(bones)}"] if bones else []
    return lines + [f"note    {note}" for note in report["notes"]]


def _written_cc(name: str, organ: OrganRecord, facts: SegmentedRecord) -> float:
    """What the label volume holds, as the report has it; that of the working grid, coarser than a drawing, where it is not told."""
    inside = facts.get("volume_in_region_cc", {})
    parts = [cc for label, cc in inside.items() if label == name or label.startswith(f"{name}_")]
    return float(sum(parts)) if parts else float(organ["volume_cc"])
