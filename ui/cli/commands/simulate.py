"""Makes a pair of scans whose stiffness is known, from the phantom, a case, or a real CT with its contours.

SPEC.json says what to make; docs/simulate.md explains every key. The case never holds its answers.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from palpate.ui.cli.arguments import no_points, random_seed
from palpate.ui.cli.console import Console

NAME, HELP = "simulate", "a pair with known stiffness, as DICOM or label volumes"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SPEC.json -o CASE --answers DIR."""
    parser.add_argument("spec", type=Path, metavar="SPEC.json", help="what to simulate")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="CASE", help="case folder to make")
    parser.add_argument(
        "--answers", type=Path, required=True, metavar="DIR", help="folder for the truth, outside the case"
    )


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Simulates; see `run_simulate`. A ``--seed`` overrides the specification's."""
    from palpate.case.steps.simulate.spec import load_spec
    from palpate.case.steps.simulate.step import run_simulate

    no_points(args)
    spec = load_spec(args.spec)
    if args.seed:
        spec["seed"] = random_seed(args)
    with console.progress(NAME) as progress:
        truth = run_simulate(spec, args.output, args.answers, progress, args.spec.absolute().parent)
    strain = 100.0 * truth["organ_strain"]["rms_largest_principal"]
    text = f"case    {args.output}\nanswers {args.answers}\nstrain  {strain:.0f} % in the organ (rms of the largest principal)"
    return {"case": str(args.output), "answers": str(args.answers), "truth": truth}, text
