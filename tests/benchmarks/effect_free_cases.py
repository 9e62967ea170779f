"""Effect-free cases of a simulator: ``python tests/benchmarks/effect_free_cases.py blind FOLDER --cases 24``.

Simulators: blind, phantom, pressure. FOLDER/NNN holds the cases noisy_voxel, noisy_exact, clean_voxel and clean_exact of one patient,
meshed, and truth.json and truth.npz. What is there already is kept.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

from palpate.core.errors import ConvergenceError
from palpate.core.worker.executors import one_thread
from palpate.validate.calibration.effect_free import EffectFree, make_effect_free
from palpate.validate.calibration.simulators import SIMULATORS


def main() -> None:
    """Prints one line a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("simulator", choices=sorted(SIMULATORS))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases", type=int, default=24)
    parser.add_argument("--seed", type=int, default=EffectFree.seed)
    parser.add_argument("--tets", type=int, default=EffectFree.target_tets, help="cells of each case's mesh")
    parser.add_argument("--sd", type=float, nargs=2, default=EffectFree.sd_mm, help="range of the contours' errors, mm")
    parser.add_argument("--plain-noise", action="store_true", help="errors of one squared exponential covariance")
    args = parser.parse_args()
    one_thread()
    options = replace(EffectFree(args.seed, target_tets=args.tets, sd_mm=tuple(args.sd)), plain_noise=args.plain_noise)
    for number in range(args.first, args.first + args.cases):
        start = time.perf_counter()
        try:
            path = make_effect_free(args.simulator, number, args.folder, options)
        except ConvergenceError as error:
            print(f"{number:03d}: {error}", flush=True)
            continue
        print(f"{path}: {time.perf_counter() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main()
