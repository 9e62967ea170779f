"""FElupe inside scipy's least squares as a bench child: moduli by finite differences, each solve from the last one's displacements."""

from __future__ import annotations

import felupe as fem
import numpy as np
from felupe_peer import prepare
from protocol import Arrays, FloatArray, Solver, serve
from scipy.optimize import least_squares

START_KPA = 30.0
# Finite difference and last step in ln G. The default difference of 1.5e-8 would read the solver's own tolerance.
DIFFERENCE, LAST_STEP = 1e-3, 1e-4


def load(scene: Arrays) -> Solver:
    """ln G of the unknown regions, and the number of equilibria."""
    solve_with = prepare(scene)
    regions = scene["regions"]
    known = {
        int(r): (float(scene["G"][regions == r][0]), float(scene["K"][regions == r][0])) for r in np.unique(regions)
    }

    def solve(steps: int, rtol: float) -> tuple[FloatArray, int]:
        last: FloatArray | None = None
        count = 0

        def residual(ln_G: FloatArray) -> FloatArray:
            nonlocal last, count
            changed = {
                int(r): (float(np.exp(v)), known[int(r)][1]) for r, v in zip(scene["unknown"], ln_G, strict=True)
            }
            last, _ = solve_with(known | changed, last, steps, rtol)
            count += 1
            return (last[scene["observed"]] - scene["measured"]).ravel()

        start = np.full(len(scene["unknown"]), np.log(START_KPA))
        found = least_squares(residual, start, diff_step=DIFFERENCE, xtol=LAST_STEP)
        return found.x, count

    return solve


if __name__ == "__main__":
    serve(load, fem.__version__)
