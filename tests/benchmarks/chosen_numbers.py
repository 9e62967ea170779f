"""What hangs on numbers that were chosen: ``python tests/benchmarks/chosen_numbers.py CASE ... --change decision_rules.hopeless=24 ...``.

Each CASE is a folder that `palpate diagnose` has been through. It is diagnosed again from its `diagnose/data.npz` with the changed numbers
of `DiagnosisOptions`, all at once; a tuple's values are parted by commas. Printed, beside what its `diagnosis.json` says: verdict,
candidates, p-value, the three largest probabilities, ln G without an effect and its standard deviation.

With ``--each FILE`` every chosen number is changed by itself to 1.5 times its value, and FILE (docs/chosen_numbers.json) holds of each what
that did to the cases; the same command goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from palpate.core.diagnose.diagnose import diagnose
from palpate.core.diagnose.effects import library
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.diagnose.verdict.record import record
from palpate.core.files.atomic import atomic_path
from palpate.core.residual.case_data import load
from palpate.core.sourced_number import Row, rows
from palpate.core.worker.executors import one_thread

# By how much a number is changed where each is changed by itself: half as much again.
FACTOR = 1.5

# Numbers of images and of bodies on a bench, which no pair of contours uses, and of what saves time or is only worded.
_NOT_OF_PAIRS = ("edge_", "local_", "bench_", "markers_")
_NO_VERDICT = ("saves time", "line of words", "no verdict")


def main() -> None:
    """Prints one JSON object a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="+", type=Path)
    parser.add_argument("--change", nargs="+", default=[])
    parser.add_argument("--each", type=Path, metavar="FILE")
    args = parser.parse_args()
    one_thread()
    if args.each is not None:
        change_each(args.cases, args.each)
        return
    options = changed(args.change)
    for path in args.cases:
        usual, now = both(path, options)
        print(json.dumps({"case": path.name, "usual": usual, "changed": now}), flush=True)


def both(path: Path, options: DiagnosisOptions) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a case's diagnosis says, and what it says with changed numbers."""
    usual = json.loads((path / "diagnosis.json").read_text(encoding="utf-8"))
    found = diagnose(load(path / "diagnose" / "data.npz"), library(), options=options)
    return told(usual), told(msgspec.json.decode(msgspec.json.encode(record(found, usual["case"]))))


def change_each(cases: list[Path], file: Path) -> None:
    """Changes every chosen number by itself, in every case, and keeps in `file` what each did."""
    kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {"factor": FACTOR, "numbers": {}}
    for name, value in chosen():
        done = kept["numbers"].setdefault(name, {})
        for path in cases:
            if path.name in done:
                continue
            usual, now = both(path, changed([f"{name}={','.join(repr(v) for v in larger(value))}"]))
            moved = np.abs(np.subtract(now["ln_G"], usual["ln_G"])) / np.array(usual["sd_ln_G"])
            done[path.name] = {
                "ln_G_in_sd": round(float(moved.max()), 3),
                "sd_ratio": [round(float(a / b), 3) for a, b in zip(now["sd_ln_G"], usual["sd_ln_G"], strict=True)],
                "p_value": [usual["p_value"], now["p_value"]],
                "verdict": [usual["verdict"], now["verdict"]],
                "candidates": [usual["candidates"], now["candidates"]],
            }
            with atomic_path(file) as new:
                new.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
            print(name, path.name, json.dumps(done[path.name]), flush=True)


def chosen() -> list[tuple[str, Row]]:
    """The numbers of pairs that were chosen and that a verdict or a stiffness may hang on, as part.name."""
    options = DiagnosisOptions()
    out = []
    for part in fields(options):
        for row in rows(getattr(options, part.name)):
            of_pairs = not row.name.startswith(_NOT_OF_PAIRS)
            if row.source.startswith("Chosen") and of_pairs and not any(word in row.source for word in _NO_VERDICT):
                out.append((f"{part.name}.{row.name}", row))
    return out


def larger(row: Row) -> list[float]:
    """The number 1.5 times as large; a share above one half is moved away from 1 by as much."""
    values = row.value if isinstance(row.value, tuple) else (row.value,)
    share = row.unit in ("1", "cosine")
    return [1.0 - (1.0 - v) * FACTOR if share and 0.5 < v < 1.0 and len(values) == 1 else v * FACTOR for v in values]


def changed(changes: list[str]) -> DiagnosisOptions:
    """The program's numbers with part.name=value; a name that there is not is refused."""
    values = DiagnosisOptions().to_json()
    for change in changes:
        (part, name), given = change.split("=")[0].split("."), [float(v) for v in change.split("=")[1].split(",")]
        before = values[part][name]
        values[part][name] = given if isinstance(before, list) else type(before)(given[0])
    return DiagnosisOptions.from_json(values)


def told(written: Mapping[str, Any]) -> dict[str, Any]:
    """What a reader would notice."""
    rows = sorted(written["ranking"], key=lambda row: -row["probability"])[:3]
    without = written["stiffness"]["without_effect"].values()
    return {
        "verdict": written["verdict"],
        "candidates": written["candidates"],
        "p_value": round(written["gap"]["p_value"], 4),
        "probability": {row["effect"]: round(row["probability"], 3) for row in rows},
        "ln_G": [round(float(np.log(s["G_kpa"])), 3) for s in without],
        "sd_ln_G": [round(s["sd_ln_G"], 3) for s in without],
    }


if __name__ == "__main__":
    main()
