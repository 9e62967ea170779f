"""Measures speed: one equilibrium and one identification beside other solvers, growth with size, workers, the reduced model.

The other solvers run as programs of their own, in an environment that is made for them on first use; what is not to be
had is listed with the reason.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.ui.cli.arguments import no_points, whole_number
from palpate.ui.cli.console import Console

if TYPE_CHECKING:
    from palpate.validate.bench.contender import Answer
    from palpate.validate.bench.identification import IdentificationTable
    from palpate.validate.bench.options import BenchOptions
    from palpate.validate.bench.run import BenchTable
    from palpate.validate.bench.scaling import Cost
    from palpate.validate.bench.steps import StepCosts

NAME, HELP = "bench", "speed against other solvers"
PEERS = ("felupe", "scikit-fem", "calculix", "dolfinx")
PARTS = ("equilibrium", "scaling", "reduced_model", "workers", "identification", "steps")
ELEMENTS = ("p1", "p1p1", "p2", "p2p0", "p2p1")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to measure."""
    parser.add_argument("--quick", action="store_true", help="small scenes, under a minute; no environment is made")
    parser.add_argument("--peer", action="append", choices=PEERS, help="only this solver beside ours; may be repeated")
    parser.add_argument(
        "--part",
        action="append",
        choices=PARTS,
        help="only this part; may be repeated; steps: the sample pair's way, where asked for",
    )
    parser.add_argument("--cells", action="append", type=whole_number(100, 1_000_000), metavar="N",
                        help="only scenes of about so many tetrahedra; may be repeated")  # fmt: skip
    parser.add_argument("--element", action="append", choices=ELEMENTS, help="only this element; may be repeated")
    parser.add_argument("--repeats", type=whole_number(1, 100), metavar="N", help="rounds of which the least counts")
    parser.add_argument("--peers-dir", type=Path, metavar="DIR", help="where the peers' environment is or shall be")


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Measures; see `run_bench`."""
    from palpate.validate.bench.run import run_bench

    no_points(args)
    with console.progress(NAME) as progress:
        table = run_bench(_options(args), progress)
    return table, "\n".join(text_of(table))


def _options(args: argparse.Namespace) -> BenchOptions:
    """The usual ones with what was chosen put in; one choice of sizes and elements serves both parts that have them."""
    from palpate.validate.bench.options import BenchOptions

    options = BenchOptions(quick=args.quick, peers_dir=args.peers_dir)
    if args.peer:
        options = replace(options, peers=tuple(args.peer))
    if args.part:
        options = replace(options, parts=tuple(args.part))
    if args.cells:
        options = replace(options, sizes=tuple(args.cells), scaling_sizes=tuple(args.cells))
    if args.element:
        options = replace(options, elements=tuple(args.element), scaling_elements=tuple(args.element))
    return replace(options, repeats=args.repeats) if args.repeats else options


def text_of(table: BenchTable) -> list[str]:
    """Every solver's least seconds on each scene, beside ours how many times slower and how far apart the solutions are; the rest."""
    machine = table["machine"]
    load = max(machine["load_before"][0], machine["load_after"][0])
    lines = [f"{machine['cpu']}, {machine['processors']} processors, load {load:.1f}, Python {machine['python']}"]
    for row in table.get("equilibrium", []):
        lines.append(f"{row['element']}, {row['cells']} cells, v1/mu {row['v1_over_mu']:g}, by {row['drive']}")
        solvers = {"palpate": row["palpate"], "palpate, stability certified": row["palpate_certified"], **row["peers"]}
        lines += [f"  {name:30} {_seconds(found)}" for name, found in solvers.items()]
    lines += _identification(table["identification"]) if "identification" in table else []
    lines += [f"skipped {name}: {why}" for name, why in table.get("skipped_peers", {}).items()]
    grown = table["scaling"]["elements"] if "scaling" in table else {}
    for element, growth in grown.items():
        lines += [f"{element}, {r['cells']} cells: {_cost(r)}" for r in growth["rows"]]
        lines.append(f"{element}: exponents {_exponent(growth['seconds_exponent'])} in seconds, "
                     f"{_exponent(growth['cpu_seconds_exponent'])} in processor seconds, "
                     f"{_exponent(growth['memory_exponent'])} in memory")  # fmt: skip
    lines += [f"reduced model, {key}: {value}" for key, value in table.get("reduced_model", {}).items()]
    lines += [f"workers, {key}: {value}" for key, value in table.get("workers", {}).items()]
    return lines + (_steps(table["steps"]) if "steps" in table else [])


def _steps(found: StepCosts) -> list[str]:
    """A step a line, its processor seconds in units of one factorisation and solve of its own mesh."""
    unit = found["factorisation_cpu_seconds"]
    head = f"one factorisation and solve, {found['unknowns']} unknowns: {unit:.3f} s of a processor"
    rows = [
        f"  {row['step']:10} {row['seconds']:7.1f} s, {row['cpu_seconds']:7.1f} s of a processor, "
        f"{row['factorisations']:6.0f} factorisations"
        for row in found["rows"]
    ]
    clock, cpu = (
        sum(each) for each in zip(*((row["seconds"], row["cpu_seconds"]) for row in found["rows"]), strict=True)
    )
    return [head, *rows, f"  {'all':10} {clock:7.1f} s, {cpu:7.1f} s of a processor, {cpu / unit:6.0f} factorisations"]


def _identification(found: IdentificationTable) -> list[str]:
    lines = [f"identification of two moduli, p1, {found['cells']} cells"]
    for name, one in {"palpate": found["palpate"], **found["peers"]}.items():
        if one["reason"]:
            lines.append(f"  {name:42} failed: {one['reason']}")
            continue
        kpa = ", ".join(f"{math.exp(v):.3f}" for v in one["ln_G"])
        ratio = f"  x {one['times_our_seconds']:.1f}" if "times_our_seconds" in one else ""
        lines.append(f"  {name:42} {one['seconds']:8.3f} s, {one['equilibria']} equilibria, {kpa} kPa{ratio}")
    return lines


def _cost(row: Cost) -> str:
    if row.get("reason"):
        return f"failed: {row['reason']}"
    return f"{row['seconds']:.3f} s, {row['cpu_seconds']:.3f} s of processor, {row['memory_mb']:.0f} MB"


def _exponent(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.2f}"


def _seconds(found: Answer) -> str:
    if found["reason"]:
        return f"failed: {found['reason']}"
    text = f"{found['seconds']:9.4f} s, {found.get('cpu_seconds', 0.0):9.4f} s of processor"
    if "times_our_seconds" in found:
        text += f"  x {found['times_our_seconds']:6.2f}, x {found['times_our_cpu_seconds']:6.2f}"
    if "largest_difference_relative" in found:
        text += f"  differs by {found['largest_difference_relative']:.1e} of the largest displacement"
    return text
