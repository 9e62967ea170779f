"""Says before a second scan is made what a deformation would tell: the error that each region's stiffness would be left with.

Needs the scan at rest only: the case's rest.nii.gz.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from palpate.ui.cli.arguments import add_case, case_of
from palpate.ui.cli.console import Console

if TYPE_CHECKING:
    from palpate.case.steps.plan import NoRow, PredictedRow

NAME, HELP = "plan", "how well a planned deformation would determine the stiffness"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """CASE, which deformation, how much of it."""
    add_case(parser)
    parser.add_argument("--deformation", choices=("balloon", "emptying", "bladder", "pressure", "posture"),
                        default="balloon", help="what deforms the organ (default %(default)s)")  # fmt: skip
    parser.add_argument(
        "--amounts",
        type=_numbers,
        default=(),
        metavar="A,B,...",
        help="ascending: mm; kPa of pressure in the rectum; degrees of turn about the long axis",
    )
    parser.add_argument("--stiffness", type=_stiffness, metavar="LABEL=KPA,...",
                        help="shear moduli G to assume (default: what was identified, else the tissue's)")  # fmt: skip
    parser.add_argument(
        "--noise", type=float, metavar="MM", help="standard deviation of a contour (default: the case's)"
    )


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Plans, and draws plan.png; see `plan_step.run`."""
    case = case_of(args)
    from palpate.case.steps import plan as plan_step
    from palpate.ui.pictures.plan_curve import plan_curve

    options = plan_step.PlanOptions(args.deformation, args.amounts, args.stiffness, args.noise)
    with console.progress(NAME) as progress:
        plan = plan_step.run(case, options, progress)
    with case.atomic_path("plan.png") as path:
        plan_curve(plan).savefig(path, dpi=150, format="png")
    lines = [f"{row['amount']:5g} {plan['unit']}   " + _told(row) for row in plan["rows"]]
    lines += [plan["verdict"], *(f"note    {note}" for note in plan["notes"])]
    return plan, "\n".join([*lines, f"picture {case.file('plan.png')}"])


def _told(row: PredictedRow | NoRow) -> str:
    if row["sd_ln_G"] is None:
        return f"no equilibrium: {row['reason']}"
    return ", ".join(f"{name} sd(ln G) {sd:.2f}" for name, sd in row["sd_ln_G"].items())


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is no list of numbers such as 2,4,6") from error


def _stiffness(text: str) -> dict[str, float]:
    try:
        pairs = [part.split("=") for part in text.split(",")]
        found = {name.strip(): float(value) for name, value in pairs}
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is not like prostate_left=20,prostate_right=60") from error
    if not all(0.1 <= value <= 5000.0 for value in found.values()):
        raise argparse.ArgumentTypeError(f"{text!r} contains a stiffness outside 0.1 to 5000 kPa")
    return found
