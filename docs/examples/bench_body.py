"""A block on a bench, pressed by a disc while markers are watched: is the model right, and how stiff is the block?

python docs/examples/bench_body.py FOLDER
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pyvista as pv

from palpate.case.bench.body import body_problem
from palpate.case.case_folder import CaseFolder
from palpate.case.steps import diagnose

DISC = {"name": "disc", "plane_point": [0, 0, 20], "plane_normal": [0, 0, 1], "centre": [15, 12, 20], "radius_mm": 9}
PRESSED = {**DISC, "displacement_mm": [0, 0, -1.0], "displacement_sd_mm": 0.02,
           "reaction_n": [None, None, -1.1], "reaction_sd_n": 0.1}  # fmt: skip
FLOOR = {"name": "floor", "plane_point": [0, 0, 0], "plane_normal": [0, 0, 1]}
# Each marker at rest and pressed, mm; the camera sees x and z.
MARKERS = """name,rest_x,rest_y,rest_z,deformed_x,deformed_y,deformed_z
a,5,0,5,5,,4.78
b,15,0,10,15,,9.55
c,25,0,15,25,,14.33
d,15,0,15,15,,14.33
"""


def write(folder: Path, cells: int = 400) -> CaseFolder:
    """The case as a person writes it: the body's surface, the markers, and case.json that says what holds and what pushes."""
    folder.mkdir(parents=True, exist_ok=True)
    pv.Box((0.0, 30.0, 0.0, 24.0, 0.0, 20.0), level=2).triangulate().clean().save(folder / "body.stl")
    (folder / "pressed.csv").write_text(MARKERS)
    state = {"name": "pressed", "points": "pressed.csv", "points_sd_mm": [0.1, None, 0.1], "moved": [PRESSED]}
    stated = {"name": "block", "body": "body.stl", "cells": cells, "supports": [FLOOR], "states": [state]}
    (folder / "case.json").write_text(json.dumps(stated, indent=1))
    return CaseFolder(folder)


def look(case: CaseFolder) -> None:
    """What was understood, before minutes are spent on it."""
    problem = body_problem(case)
    print(
        f"{len(problem.mesh.cells)} tetrahedra, {problem.states[0].seen.sum()} numbers seen, {len(problem.held)} nodes held"
    )


def solve(case: CaseFolder) -> None:
    """Stiffness and what the model leaves out: minutes."""
    found = diagnose.run(case)
    print(found.verdict, found.candidates)


if __name__ == "__main__":
    made = write(Path(sys.argv[1]))
    look(made)
    solve(made)
