"""Two scans with contours of a person, RTSTRUCT or any other form, to a stiffness with its interval.

python docs/examples/real_contours.py REST DEFORMED REST_CONTOURS DEFORMED_CONTOURS CASE
"""

from __future__ import annotations

import sys
from pathlib import Path

import palpate
from palpate.case.case_folder import CaseFolder
from palpate.case.steps import identify, mesh
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.case.steps.import_scans.pair import run_import
from palpate.case.steps.segment import run_segment
from palpate.core.identify.options import IdentifyOptions


def read(rest: Path, deformed: Path, contours: tuple[Path, Path], case: Path, align: bool = True) -> CaseFolder:
    """Imports the pair with its contours, whatever their form; aligned on bone unless both lie in one frame already."""
    told = run_import(rest, deformed, case, ImportOptions(labels=contours, align=align))
    print(*told.get("notes", []), sep="\n")
    return CaseFolder(case)


def solve(case: CaseFolder) -> None:
    """Fills in what nobody has drawn, with the volume of each label in cc; meshes and identifies: minutes."""
    for state, facts in run_segment(case)["states"].items():
        print(state, {name: round(organ["volume_cc"], 1) for name, organ in facts["organs"].items()})
    mesh.run(case)
    identify.run(case, IdentifyOptions(workers=2))
    print(palpate.load(case.path))


if __name__ == "__main__":
    given = [Path(word) for word in sys.argv[1:]]
    solve(read(given[0], given[1], (given[2], given[3]), given[4]))
