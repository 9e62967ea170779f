"""Many patients from one table, each the whole way from two scans to a report.

TABLE is CSV with the columns name, rest, deformed and, if wanted, rest_labels, deformed_labels, registration; paths are relative
to its folder.
A patient who fails, or whose row is wrong, is told and passed over. FOLDER/results.csv has one line a patient: stiffness,
interval, how sure, misfit, verdict and its p-value, where the contours are from, and warnings. The same command goes on where it stopped.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from palpate.core.errors import InputError
from palpate.ui.cli.arguments import no_points, whole_number
from palpate.ui.cli.console import Console

NAME, HELP = "batch", "many patients from one table"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """TABLE -o FOLDER."""
    parser.add_argument(
        "table",
        type=Path,
        metavar="TABLE",
        help="CSV: name, rest, deformed, rest_labels, deformed_labels, registration",
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FOLDER", help="folder for a case of each patient"
    )
    parser.add_argument(
        "--parallel", type=whole_number(1, 64), default=1, metavar="N", help="patients at once (default 1)"
    )
    parser.add_argument("--cluster", metavar="ADDRESS",
                        help="Dask scheduler whose workers do the patients; all must see the same folders")  # fmt: skip


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Runs all; see `palpate.ui.cli.batch`. Raises InputError, when all are through, where one failed."""
    from palpate.ui.cli import batch  # here, as all that help does not need

    no_points(args)
    patients = batch.read_table(args.table)
    given = [("--workers", args.workers), ("--seed", next(iter(args.seed), None))]
    options = [word for name, value in given if value is not None for word in (name, str(value))]
    done = 0
    with console.progress(NAME) as progress:

        def told(count: int, outcome: batch.Outcome) -> None:
            nonlocal done
            done = count
            progress(count / len(patients), f"{outcome.name}: {outcome.error or outcome.status}")

        def heard(line: str) -> None:
            progress(done / len(patients), line)

        progress(0.0, f"{len(patients)} patients")
        outcomes = batch.run_all(patients, args.output, options, args.parallel, told, cluster=args.cluster, heard=heard)
    failed = [one for one in outcomes if one.status == batch.FAILED]
    results = args.output / batch.RESULTS
    rows = [{"name": one.name, "status": one.status, "error": one.error, **one.values} for one in outcomes]
    if failed:
        said = "; ".join(f"{one.name}: {one.error}" for one in failed)
        error = InputError(f"{len(failed)} of {len(outcomes)} patients failed; {results} has the others; {said}")
        error.facts = {"patients": rows}
        raise error
    return {"results": str(results), "patients": rows}, f"{len(outcomes)} patients done; figures in {results}"
