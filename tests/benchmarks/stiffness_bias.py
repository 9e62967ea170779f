"""How far walls read wrongly pull the diagnosis's stiffness: ``python tests/benchmarks/stiffness_bias.py CASE ...``.

Printed are, for each meshed or unmeshed case folder, what is taken off the plain model's ln G for it (beside what effect-free cases
are too high by anyway, `too_stiff`) and the standard deviation that is reported of it, one number a stiffness.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from gap_noise import plain_of

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.verdict.model_average import plain_stiffness, too_stiff_by
from palpate.core.worker.executors import one_thread


def main() -> None:
    """Prints one JSON object a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="+", type=Path)
    args = parser.parse_args()
    one_thread()
    rules = DecisionRules()
    for path in args.cases:
        fit = plain_of(path)
        told_theta, covariance = plain_stiffness(fit, rules)
        calibrated = too_stiff_by(covariance / rules.wider**2, rules)
        bias, sd = fit.linearisation.theta - told_theta - calibrated, np.sqrt(np.diag(covariance))
        in_sd = (bias / sd).round(2).tolist()
        told = {"case": path.name, "bias_ln_G": bias.round(3).tolist(), "sd_ln_G": sd.round(3).tolist(), "in_sd": in_sd}
        print(json.dumps(told), flush=True)


if __name__ == "__main__":
    main()
