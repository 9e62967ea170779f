"""Before a second scan: how well would an emptied rectum tell the stiffness?

python docs/examples/plan.py CASE
"""

from __future__ import annotations

import sys
from pathlib import Path

from palpate.case.case_folder import CaseFolder
from palpate.case.steps import plan
from palpate.case.steps.plan import PlanOptions


def main(case: Path, options: PlanOptions) -> None:
    """A line for each amount: within which factor each region's stiffness would be known."""
    found = plan.run(CaseFolder(case), options)
    for row in found["rows"]:
        if row["sd_ln_G"] is None:
            print(f"{row['amount']} {found['unit']}: {row['reason']}")
        else:
            known = {name: f"x/ {2.718281828 ** (1.96 * sd):.2f}" for name, sd in row["sd_ln_G"].items()}
            print(f"{row['amount']} {found['unit']}: {known}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), PlanOptions(deformation="emptying"))
