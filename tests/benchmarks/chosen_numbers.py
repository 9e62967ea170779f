"""What hangs on numbers that were chosen: ``python tests/benchmarks/chosen_numbers.py CASE ... --change decision_rules.hopeless=24 ...``.

Each CASE is a folder that `palpate diagnose` has been through. It is diagnosed again from its `diagnose/data.npz` with the changed numbers
of `DiagnosisOptions`, all at once; a tuple's values are parted by commas. Printed, beside what its `diagnosis.json` says: verdict,
candidates, p-value, the three largest probabilities, ln G without an effect and its standard deviation.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from palpate.core.diagnose.diagnose import diagnose
from palpate.core.diagnose.effects import library
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.diagnose.verdict.record import record
from palpate.core.residual.case_data import load
from palpate.core.worker.executors import one_thread


def main() -> None:
    """Prints one JSON object a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="+", type=Path)
    parser.add_argument("--change", nargs="+", default=[])
    args = parser.parse_args()
    one_thread()
    options = changed(args.change)
    for path in args.cases:
        usual = json.loads((path / "diagnosis.json").read_text(encoding="utf-8"))
        found = diagnose(load(path / "diagnose" / "data.npz"), library(), options=options)
        now = msgspec.json.decode(msgspec.json.encode(record(found, usual["case"])))
        print(json.dumps({"case": path.name, "usual": told(usual), "changed": told(now)}), flush=True)


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
