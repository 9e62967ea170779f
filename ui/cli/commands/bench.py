"""Measures speed: one equilibrium beside other solvers on the same mesh, growth with size, workers, the reduced model.

The other solvers run as programs of their own, in an environment that is made for them on first use; what is not to be
had is listed with the reason.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from palpate.ui.cli.arguments import no_points, whole_number
from palpate.ui.cli.console import Console

NAME, HELP = "bench", "speed against other solvers"
PEERS = ("felupe", "scikit-fem", "calculix", "dolfinx")
PARTS = ("equilibrium", "scaling", "reduced_model", "workers")
ELEMENTS = ("p1", "p1p1", "p2", "p2p0", "p2p1")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to measure."""
    parser.add_argument("--quick", action="store_true", help="small scenes, under a minute; no environment is made")
    parser.add_argument("--peer", action="append", choices=PEERS, help="only this solver beside ours; may be repeated")
    parser.add_argument("--part", action="append", choices=PARTS, help="only this part; may be repeated")
    parser.add_argument("--cells", action="append", type=whole_number(100, 1_000_000), metavar="N",
                        help="only scenes of about so many tetrahedra; may be repeated")  # fmt: skip
    parser.add_argument("--element", action="append", choices=ELEMENTS, help="only this element; may be repeated")
    parser.add_argument("--repeats", type=whole_number(1, 100), metavar="N", help="rounds of which the least counts")
    parser.add_argument("--peers-dir", type=Path, metavar="DIR", help="where the peers' environment is or shall be")


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Measures; see `run_bench`."""
    from palpate.validate.bench.run import BenchOptions, run_bench

    no_points(args)
    chosen: dict[str, Any] = {"peers": args.peer, "parts": args.part, "sizes": args.cells, "scaling_sizes": args.cells,
              "elements": args.element, "scaling_elements": args.element}  # fmt: skip
    given: dict[str, Any] = {name: tuple(values) for name, values in chosen.items() if values}
    options = replace(BenchOptions(quick=args.quick, peers_dir=args.peers_dir), **given)
    if args.repeats:
        options = replace(options, repeats=args.repeats)
    with console.progress(NAME) as progress:
        table = run_bench(options, progress)
    return table, "\n".join(text_of(table))


def text_of(table: dict[str, Any]) -> list[str]:
    """Every solver's least seconds on each scene, beside ours how many times slower and how far apart the solutions are; the rest."""
    machine = table["machine"]
    load = max(machine["load_before"][0], machine["load_after"][0])
    lines = [f"{machine['cpu']}, {machine['processors']} processors, load {load:.1f}, Python {machine['python']}"]
    for row in table.get("equilibrium", []):
        lines.append(f"{row['element']}, {row['cells']} cells, v1/mu {row['v1_over_mu']:g}, by {row['drive']}")
        solvers = {"palpate": row["palpate"], "palpate, stability certified": row["palpate_certified"], **row["peers"]}
        lines += [f"  {name:30} {_seconds(found)}" for name, found in solvers.items()]
    lines += [f"skipped {name}: {why}" for name, why in table.get("skipped_peers", {}).items()]
    for element, grown in table.get("scaling", {}).get("elements", {}).items():
        lines += [f"{element}, {r['cells']} cells: {_cost(r)}" for r in grown["rows"]]
        lines.append(f"{element}: exponents {_exponent(grown, 'seconds')} in seconds, "
                     f"{_exponent(grown, 'cpu_seconds')} in processor seconds, {_exponent(grown, 'memory')} in memory")  # fmt: skip
    for part in ("reduced_model", "workers"):
        lines += [f"{part.replace('_', ' ')}, {key}: {value}" for key, value in table.get(part, {}).items()]
    return lines


def _cost(row: dict[str, Any]) -> str:
    if row.get("reason"):
        return f"failed: {row['reason']}"
    return f"{row['seconds']:.3f} s, {row['cpu_seconds']:.3f} s of processor, {row['memory_mb']:.0f} MB"


def _exponent(grown: dict[str, Any], what: str) -> str:
    value = grown[f"{what}_exponent"]
    return "unknown" if value is None else f"{value:.2f}"


def _seconds(found: dict[str, Any]) -> str:
    if found["reason"]:
        return f"failed: {found['reason']}"
    text = f"{found['seconds']:9.4f} s, {found.get('cpu_seconds', 0.0):9.4f} s of processor"
    if "times_our_seconds" in found:
        text += f"  x {found['times_our_seconds']:6.2f}, x {found['times_our_cpu_seconds']:6.2f}"
    if "largest_difference_relative" in found:
        text += f"  differs by {found['largest_difference_relative']:.1e} of the largest displacement"
    return text
