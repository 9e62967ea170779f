"""Errors of the plain fit on meshed cases of known stiffness: ``python tests/benchmarks/fit_errors.py CASE ...``.

Each CASE is a case folder without a hidden effect that holds `truth.json` with `{"G": [left, right]}`, kPa. Printed are the
errors of ln G and their stated standard deviations, and of all cases the mean error, the mean and rms error over the standard
deviation, and how many lie within 95 % of a normal.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from gap_noise import plain_of

from palpate.core.worker.executors import one_thread


def main() -> None:
    """Prints one JSON object a case, then one of all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="+", type=Path)
    one_thread()
    errors, sds = [], []
    for path in parser.parse_args().cases:
        truth = np.log(json.loads((path / "truth.json").read_text(encoding="utf-8"))["G"])
        posterior = plain_of(path).posterior
        errors.append(posterior.mean - truth)
        sds.append(posterior.sd)
        told = {"case": str(path), "error_ln_G": errors[-1].round(3).tolist(), "sd_ln_G": sds[-1].round(3).tolist()}
        print(json.dumps(told), flush=True)
    z = np.concatenate(errors) / np.concatenate(sds)
    print(
        json.dumps(
            {
                "halves": len(z),
                "mean_error": round(float(np.mean(errors)), 3),
                "mean_z": round(float(z.mean()), 2),
                "rms_z": round(float(np.sqrt((z**2).mean())), 2),
                "inside": int((np.abs(z) < 1.96).sum()),
                "median_sd": round(float(np.median(sds)), 2),
            }
        )
    )


if __name__ == "__main__":
    main()
