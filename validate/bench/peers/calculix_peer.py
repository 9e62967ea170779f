"""CalculiX (`ccx`) as a bench child: writes its input deck, runs it, reads the displacements back.

The time of a run that only reads and checks the deck is taken off, so that what is compared is the solution alone.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from protocol import Arrays, FloatArray, Solver, Timed, serve


def deck(scene: Arrays, rtol: float, analyse: bool) -> str:
    """Input deck; CalculiX numbers from 1, takes our order of mid-edge nodes, and reads 20 characters of a number at most."""
    nodes, cells = scene["nodes"], scene["cells"]
    kind = "C3D10" if cells.shape[1] == 10 else "C3D4"
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{i + 1},{x:.11g},{y:.11g},{z:.11g}" for i, (x, y, z) in enumerate(nodes)]
    for region in np.unique(scene["regions"]):
        lines.append(f"*ELEMENT, TYPE={kind}, ELSET=E{region}")
        lines += [
            f"{i + 1}," + ",".join(str(n + 1) for n in cells[i]) for i in np.flatnonzero(scene["regions"] == region)
        ]
        first = np.flatnonzero(scene["regions"] == region)[0]
        G, K = scene["G"][first], scene["K"][first]
        lines += [f"*MATERIAL, NAME=M{region}", "*HYPERELASTIC, NEO HOOKE", f"{G / 2:.11g},{2 / K:.11g}"]
        lines.append(f"*SOLID SECTION, ELSET=E{region}, MATERIAL=M{region}")
    if not analyse:
        return "\n".join([*lines, "*STEP", "*NO ANALYSIS", "*END STEP", ""])
    lines += ["*STEP, NLGEOM, INC=200", "*STATIC", "1.,1.,1e-3"]
    lines += ["*CONTROLS, PARAMETERS=FIELD", f"{rtol:g},{rtol:g},,,{rtol:g}"]
    held = np.argwhere(scene["fixed"])
    lines += ["*BOUNDARY", *(f"{n + 1},{c + 1},{c + 1},{scene['prescribed'][n, c]:.11g}" for n, c in held)]
    loaded = np.argwhere(scene["force"] != 0.0)
    if len(loaded):
        lines += ["*CLOAD", *(f"{n + 1},{c + 1},{scene['force'][n, c]:.11g}" for n, c in loaded)]
    return "\n".join([*lines, "*NODE PRINT, NSET=NALL", "U", "*END STEP", ""])


def run(folder: Path) -> tuple[float, float, str]:
    """Wall-clock and processor seconds, and what it printed."""
    start, cpu = time.perf_counter(), children_seconds()
    done = subprocess.run(["ccx", "-i", "job"], cwd=folder, capture_output=True, text=True, check=False)
    return time.perf_counter() - start, children_seconds() - cpu, done.stdout + done.stderr


def children_seconds() -> float:
    """Processor seconds of all children that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def load(scene: Arrays) -> Solver:
    folder = Path(tempfile.mkdtemp(prefix="palpate-ccx-"))
    try:
        (folder / "job.inp").write_text(deck(scene, 1e-8, False))
        reading = np.min([run(folder)[:2] for _ in range(2)], axis=0)
    finally:
        shutil.rmtree(folder)

    def solve(steps: int, rtol: float) -> tuple[FloatArray, Timed]:
        folder = Path(tempfile.mkdtemp(prefix="palpate-ccx-"))
        try:
            (folder / "job.inp").write_text(deck(scene, rtol, True))
            *seconds, log = run(folder)
            if "Job finished" not in log:
                raise ArithmeticError(
                    next((x.strip() for x in log.splitlines() if "*ERROR" in x), "ccx did not finish")
                )
            u = displacements((folder / "job.dat").read_text(), len(scene["nodes"]))
        finally:
            shutil.rmtree(folder)
        wall, cpu = np.maximum(seconds - reading, 1e-9)
        return u, Timed(len(re.findall(r"^ iteration ", log, re.MULTILINE)), float(wall), float(cpu))

    return solve


def displacements(text: str, n: int) -> FloatArray:
    """(n, 3) of the last increment in a .dat file."""
    table = text[text.rindex("displacements") :].splitlines()[1:]
    rows = [line.split() for line in table if len(line.split()) == 4]
    u = np.full((n, 3), np.nan)
    for node, *values in rows:
        u[int(node) - 1] = [float(v) for v in values]
    return u


def version() -> str:
    """What `ccx -v` says."""
    said = subprocess.run(["ccx", "-v"], capture_output=True, text=True, check=False).stdout
    return said.strip().split()[-1] if said.strip() else ""


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    serve(load, version())
