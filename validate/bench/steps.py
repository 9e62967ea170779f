"""What each step of the sample pair's way from two scans to a report costs, beside one factorisation of its own mesh.

The steps run as programs, as a person starts them, so that what they load counts too. Both are measured in the same run:
on a busy machine a step and the factorisation take longer alike, and their ratio tells more than the seconds.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypedDict

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.problem import problem_of
from palpate.case.sample.scans import sample_scans
from palpate.core.errors import PalpateError
from palpate.core.fem.state import State
from palpate.core.forward.composition_scene import plain_scene
from palpate.core.inference.starts import middle
from palpate.core.residual.fit_options import QUICK

STEPS = ("import", "segment", "mesh", "identify", "diagnose", "report")
# Factorisations of which the least counts.
_ROUNDS = 7


class StepCost(TypedDict):
    """One step: by the clock, processor seconds of all its processes, and these over those of a factorisation and a solve."""

    step: str
    seconds: float
    cpu_seconds: float
    factorisations: float


class StepCosts(TypedDict):
    """All steps. factorisation_cpu_seconds : one factorisation and one solve of the case's mesh with the quick element, of
    so many unknowns."""

    factorisation_cpu_seconds: float
    unknowns: int
    rows: list[StepCost]


def step_costs(folder: Path, tell: Callable[[float, str], None]) -> StepCosts:
    """Raises PalpateError when a step fails."""
    case, spent = folder / "sample", []
    for k, step in enumerate(STEPS):
        tell(k / len(STEPS), f"steps: {step}")
        spent.append(_spent(step, case))
    unknowns, unit = factorisation_cpu_seconds(CaseFolder(case))
    rows: list[StepCost] = [
        {"step": step, "seconds": clock, "cpu_seconds": cpu, "factorisations": cpu / unit}
        for step, (clock, cpu) in zip(STEPS, spent, strict=True)
    ]
    return {"factorisation_cpu_seconds": unit, "unknowns": unknowns, "rows": rows}


def factorisation_cpu_seconds(case: CaseFolder) -> tuple[int, float]:
    """Unknowns of a meshed case's plain model with the quick element, and the least processor seconds of one factorisation of
    its tangent at rest and one solve with it."""
    scene = plain_scene(problem_of(case), QUICK)
    assembler, u = scene.assembler, np.zeros((scene.space.n_nodes, 3))
    assembler.set_materials(scene.materials(middle(scene.parameters.bounds)))
    assembler.terms = scene.terms
    values = assembler.tangent(State(u, assembler.balanced_pressure(u)), 1.0)[0]
    force, least = np.ones(assembler.pattern.n), np.inf
    for _ in range(_ROUNDS):
        began = time.process_time()
        assembler.solver.factorise(values)
        assembler.solver.solve(force)
        least = min(least, time.process_time() - began)
    return assembler.pattern.n, least


def _spent(step: str, case: Path) -> tuple[float, float]:
    """Seconds by the clock and of the processor that a step takes, with all the processes that it starts and waits for."""
    scans = [str(folder) for folder in sample_scans()]
    where = [*scans, "-o", str(case)] if step == "import" else [str(case)]
    command = [sys.executable, "-m", "palpate.ui.cli", step, *where, "--quiet"]
    before, began = os.times(), time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    after = os.times()
    if done.returncode != 0:
        last = (done.stderr or done.stdout).strip().splitlines()[-1:] or ["no message"]
        raise PalpateError(f"the step {step} of the sample pair ended with status {done.returncode}: {last[0]}")
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return time.perf_counter() - began, cpu
