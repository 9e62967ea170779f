"""How far walls read wrongly pull the diagnosis's stiffness: ``python tests/benchmarks/stiffness_bias.py CASE ...``.

The fit takes the walls' motion for known. What is wrong with it moves the predicted organ, the less the stiffer the organ is, so that
a sum of squares with fixed weights W has its minimum at too stiff an organ (errors in variables; Fuller 1987, chapter 1). To first order
ln G is off by -C g / 2, g the derivative of tr(W S) in ln G, S the covariance of the data at that stiffness and C that of ln G.
Printed are, for each meshed or unmeshed case folder, that bias and the standard deviation of ln G, one number a stiffness.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from gap_noise import plain_of
from numpy.typing import NDArray

from palpate.core.gap.fit import NOTHING, PLAIN
from palpate.core.gap.noise_model import NoiseParts
from palpate.core.gap.plain import FLAT, PlainFit
from palpate.core.worker.executors import one_thread

_STEP = 0.1  # of ln G


def main() -> None:
    """Prints one JSON object a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="+", type=Path)
    args = parser.parse_args()
    one_thread()
    for path in args.cases:
        bias, sd = bias_of(plain_of(path))
        in_sd = (bias / sd).round(2).tolist()
        told = {"case": path.name, "bias_ln_G": bias.round(3).tolist(), "sd_ln_G": sd.round(3).tolist(), "in_sd": in_sd}
        print(json.dumps(told), flush=True)


def bias_of(fit: PlainFit) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(t,) the bias of ln G by what is not known of the walls, and (t,) its standard deviation."""
    J = fit.weighting.whiten(fit.point.in_theta)
    covariance = np.linalg.inv(J.T @ J + FLAT * np.eye(J.shape[1]))
    g = np.array([(_noise(fit, k, _STEP) - _noise(fit, k, -_STEP)) / (2.0 * _STEP) for k in range(J.shape[1])])
    return -0.5 * covariance @ g, np.sqrt(np.diag(covariance))


def _noise(fit: PlainFit, which: int, step: float) -> float:
    """tr(W S) with one ln G moved by a step."""
    theta = fit.point.theta.copy()
    theta[which] += step
    point = fit.bench.solve(PLAIN, theta, NOTHING, fit.point)
    if point is None:
        raise SystemExit(f"no equilibrium at ln G = {theta.round(2).tolist()}")
    S = NoiseParts.of(point.each, fit.bench.sights).covariance(fit.sizes, np.zeros((fit.bench.n, 1)))
    return float(np.trace(fit.weighting.whiten(fit.weighting.whiten(S).T)))


if __name__ == "__main__":
    main()
