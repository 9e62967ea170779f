"""Fuzzing at length: ``python tests/fuzz/run.py --runs 1000000 [--only NAME]``; what breaks a parser is kept in corpus/.

Runs are shared among the parsers. Ends with 1 when a parser raised anything but its one-line refusal.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import logging
import sys
import tempfile
import time
from datetime import timedelta
from pathlib import Path

from damage import check, damaged
from hypothesis import HealthCheck, Phase, given, seed, settings
from targets import Target, all_targets

CORPUS = Path(__file__).parent / "corpus"
# hypothesis remembers every example of a round; rounds keep that memory small.
ROUND = 2000
_MEMORY = Path("/dev/shm")


def main() -> int:
    """Runs, prints one JSON object per parser, and returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100_000, help="in all (default %(default)s)")
    parser.add_argument("--only", help="one parser")
    parser.add_argument("--seed", type=int, default=1, help="of the first round (default %(default)s)")
    args = parser.parse_args()
    # VTK's readers tell their complaints to the log.
    logging.disable(logging.CRITICAL)
    broken = 0
    with tempfile.TemporaryDirectory(dir=_MEMORY if _MEMORY.is_dir() else None) as folder:
        targets = [t for t in all_targets(Path(folder)) if args.only in (None, t.name)]
        if not targets:
            parser.error(f"there is no parser {args.only}")
        for target in targets:
            broken += _fuzz(target, args.runs // len(targets), args.seed)
    return 1 if broken else 0


def _fuzz(target: Target, runs: int, first_seed: int) -> int:
    good, began = target.path.read_bytes(), time.monotonic()
    counts = {"runs": 0, "refused": 0}
    broken: set[str] = set()
    rounds = -(-runs // ROUND)
    for number in range(rounds):
        wanted = min(ROUND, runs - number * ROUND)
        last = b""

        @seed(first_seed + number)
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
            broken.add(f"{type(error).__name__}: {str(error)[:200]}")
            _keep(target, last)
    target.path.write_bytes(good)
    seconds = round(time.monotonic() - began, 1)
    print(json.dumps({"parser": target.name, **counts, "broken": sorted(broken), "seconds": seconds}), flush=True)
    return len(broken)


def _keep(target: Target, data: bytes) -> None:
    folder = CORPUS / target.name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / hashlib.sha256(data).hexdigest()[:12]).write_bytes(data)


if __name__ == "__main__":
    sys.exit(main())
