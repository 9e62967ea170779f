"""Measures speed: one equilibrium beside other solvers on the same mesh, growth with size, workers, the reduced model.

The other solvers run as programs of their own, in an environment that is made for them on first use; what is not to be
had is listed with the reason.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from palpate.ui.cli.arguments import no_points
from palpate.ui.cli.console import Console

NAME, HELP = "bench", "speed against other solvers"
PEERS = ("felupe", "scikit-fem", "calculix", "dolfinx")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to measure."""
    parser.add_argument("--quick", action="store_true", help="small scenes, under a minute; no environment is made")
    parser.add_argument("--peer", action="append", choices=PEERS, help="only this solver beside ours; may be repeated")
    parser.add_argument("--peers-dir", type=Path, metavar="DIR", help="where the peers' environment is or shall be")


def run(args: argparse.Namespace, console: Console) -> tuple[dict[str, Any], str]:
    """Measures; see `run_bench`."""
    from palpate.core.bench.run import BenchOptions, run_bench

    no_points(args)
    peers = None if args.peer is None else tuple(args.peer)
    with console.progress(NAME) as progress:
        table = run_bench(BenchOptions(quick=args.quick, peers=peers, peers_dir=args.peers_dir), progress)
    return table, "\n".join(text_of(table))


def text_of(table: dict[str, Any]) -> list[str]:
    """Every solver's median seconds on each scene, beside ours how many times slower and how far apart the solutions are."""
    machine = table["machine"]
    load = max(machine["load_before"][0], machine["load_after"][0])
    lines = [f"{machine['cpu']}, {machine['processors']} processors, load {load:.1f}, Python {machine['python']}"]
    for row in table["equilibrium"]:
        lines.append(f"{row['element']}, {row['cells']} cells, v1/mu {row['v1_over_mu']:g}, by {row['drive']}")
        solvers = {"palpate": row["palpate"], "palpate, stability certified": row["palpate_certified"], **row["peers"]}
        lines += [f"  {name:30} {_seconds(found)}" for name, found in solvers.items()]
    return lines + [f"skipped {name}: {why}" for name, why in table["skipped_peers"].items()]


def _seconds(found: dict[str, Any]) -> str:
    if found["reason"]:
        return f"failed: {found['reason']}"
    text = f"{found['seconds']:9.4f} s"
    if "times_our_seconds" in found:
        text += f"  x {found['times_our_seconds']:6.2f}"
    if "largest_difference_relative" in found:
        text += f"  differs by {found['largest_difference_relative']:.1e} of the largest displacement"
    return text
