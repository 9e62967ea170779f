"""Many patients: a table in, a table out; who fails is told and passed over.

python docs/examples/batch.py TABLE.csv FOLDER
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from pathlib import Path

from palpate.ui.cli.batch import RESULTS, read_table, run_all


def main(table: Path, folder: Path, program: Sequence[str] = ()) -> list[dict[str, str]]:
    """Runs all, one after the other; the rows of the results. program : another than this one, as tests need it."""
    patients = read_table(table)
    run_all(
        patients,
        folder,
        ["--no-diagnosis"],
        1,
        lambda count, one: print(count, one.name, one.error or one.status),
        program,
    )
    with (folder / RESULTS).open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        print(row["name"], row["status"], row["prostate_left_kpa"], row["prostate_right_kpa"])
    return rows


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
