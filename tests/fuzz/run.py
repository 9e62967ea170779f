"""Fuzzing at length: ``python tests/fuzz/run.py --runs 1000000 [--only NAME]``; what breaks a parser is kept in corpus/.

Runs are shared among the parsers, a round of each in turn. With --state FILE a run that was stopped goes on where it was, at the same
commit. Ends with 1 when a parser raised anything but its one-line refusal, or ended its process.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any

from damage import check, damaged
from hypothesis import HealthCheck, Phase, given, seed, settings
from targets import Target, all_targets

from palpate.core.files.atomic import atomic_path

CORPUS = Path(__file__).parent / "corpus"
# hypothesis remembers every example of a round; rounds keep that memory small, and the state file near what was done.
ROUND = 200
_MEMORY = Path("/dev/shm")


def main() -> int:
    """Runs, prints one JSON object per parser, and returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100_000, help="in all (default %(default)s)")
    parser.add_argument("--only", help="one parser")
    parser.add_argument("--seed", type=int, default=1, help="of the first round (default %(default)s)")
    parser.add_argument("--state", type=Path, help="file that keeps what was done; of another commit it is begun anew")
    args = parser.parse_args()
    # VTK's readers tell their complaints to the log.
    logging.disable(logging.CRITICAL)
    with tempfile.TemporaryDirectory(dir=_MEMORY if _MEMORY.is_dir() else None) as folder:
        targets = [t for t in all_targets(Path(folder)) if args.only in (None, t.name)]
        if not targets:
            parser.error(f"there is no parser {args.only}")
        found = _kept(args.state, targets)
        share = args.runs // len(targets)
        for done in range(0, share, ROUND):
            for target in targets:
                counts = found[target.name]
                if counts["rounds"] * ROUND <= done:
                    _apart(target, counts, min(ROUND, share - done), args.seed + done // ROUND)
                    _keep_state(args.state, found)
    for name, counts in found.items():
        print(json.dumps({"parser": name, **counts}))
    return 1 if any(counts["broken"] for counts in found.values()) else 0


def _apart(target: Target, counts: dict[str, Any], wanted: int, round_seed: int) -> None:
    """A round in a process of its own where the system can: a library's crash is a finding, and does not end the run."""
    if not hasattr(os, "fork"):
        return _round(target, counts, wanted, round_seed)
    good, (reader, writer) = target.path.read_bytes(), os.pipe()
    child = os.fork()
    if child == 0:
        _round(target, counts, wanted, round_seed)
        os.write(writer, json.dumps(counts).encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as stream:
        told = stream.read()
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if told:
        counts.update(json.loads(told))
        return None
    counts["broken"] = sorted({*counts["broken"], f"its process ended with {status}"})
    _keep(target, target.path.read_bytes())
    target.path.write_bytes(good)
    counts["rounds"] += 1
    return None


def _round(target: Target, counts: dict[str, Any], wanted: int, round_seed: int) -> None:
    """Adds what a round found to the counts of a parser; what breaks it ends the round."""
    good, began, last = target.path.read_bytes(), time.monotonic(), b""

    @seed(round_seed)
    @settings(max_examples=wanted, deadline=timedelta(seconds=10), database=None, phases=(Phase.generate,),
              suppress_health_check=list(HealthCheck))  # fmt: skip
    @given(damaged(good, target.is_text))
    def run(data: bytes) -> None:
        nonlocal last
        last = data
        counts["runs"] += 1
        counts["refused"] += check(target, data)

    try:
        run()
    except Exception as error:  # noqa: BLE001 - what any exception is, is the finding
        counts["broken"] = sorted({*counts["broken"], f"{type(error).__name__}: {str(error)[:200]}"})
        _keep(target, last)
    target.path.write_bytes(good)
    counts["rounds"] += 1
    counts["seconds"] = round(counts["seconds"] + time.monotonic() - began, 1)


def _kept(path: Path | None, targets: Sequence[Target]) -> dict[str, dict[str, Any]]:
    """Counts by parser, as the state file has them of this commit, else none."""
    fresh = {target.name: {"rounds": 0, "runs": 0, "refused": 0, "broken": [], "seconds": 0.0} for target in targets}
    if path is None or not path.is_file():
        return fresh
    kept = json.loads(path.read_text(encoding="utf-8"))
    return {name: kept["parsers"].get(name, fresh[name]) for name in fresh} if kept["commit"] == _commit() else fresh


def _keep_state(path: Path | None, found: dict[str, dict[str, Any]]) -> None:
    if path is not None:
        done = sum(counts["runs"] for counts in found.values())
        with atomic_path(path) as temporary:
            temporary.write_text(
                json.dumps({"commit": _commit(), "runs": done, "parsers": found}, indent=1), encoding="utf-8"
            )


def _commit() -> str:
    said = subprocess.run(["git", "rev-parse", "HEAD"], cwd=CORPUS.parent, capture_output=True, text=True, check=True)
    return said.stdout.strip()


def _keep(target: Target, data: bytes) -> None:
    folder = CORPUS / target.name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / hashlib.sha256(data).hexdigest()[:12]).write_bytes(data)


if __name__ == "__main__":
    sys.exit(main())
