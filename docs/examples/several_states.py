"""A third scan of the same organ: its labels join the case, and one stiffness has to explain both deformations.

python docs/examples/several_states.py CASE FURTHER_LABELS.nii.gz
"""

from __future__ import annotations

import sys
from pathlib import Path

from palpate.case.case_folder import CaseFolder
from palpate.case.deformed_states import NewState, add_state
from palpate.case.steps import identify
from palpate.core.identify.options import IdentifyOptions


def add(case: Path, labels: Path, align: bool = True) -> CaseFolder:
    """Adds the state, aligned on bone; adding the same file again changes nothing."""
    folder = CaseFolder(case)
    state = add_state(folder, NewState(labels, align=align))
    print(f"{state.name}: {state.labels}")
    return folder


def solve(case: CaseFolder) -> None:
    """One stiffness from all states: minutes."""
    for name, region in identify.run(case, IdentifyOptions(workers=2)).parameters.items():
        print(name, f"{region.G_kpa:.1f} kPa", region.ci95_kpa)


if __name__ == "__main__":
    solve(add(Path(sys.argv[1]), Path(sys.argv[2])))
