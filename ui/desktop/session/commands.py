"""What the window asks the worker to do, as the command line would be told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from palpate.case.case_folder import STATES
from palpate.core.arrays import FloatArray
from palpate.core.worker.job import Job
from palpate.ui.cli.arguments import cores
from palpate.ui.desktop.session import read_scans, step_job


def import_command(
    rest: Path,
    deformed: Path,
    case: Path,
    labels: tuple[Path | None, Path | None] = (None, None),
) -> list[str]:
    """Two folders to a case. labels : contours of the scan at rest and of the deformed one."""
    # Absolute paths, because a name that begins with a dash would be an option.
    command = ["import", str(rest.absolute()), str(deformed.absolute()), "-o", str(case.absolute())]
    for state, path in zip(STATES, labels, strict=True):
        command += [] if path is None else [f"--{state}-labels", str(path.absolute())]
    return command


def step_command(
    step: str, case: Path, seeds: Mapping[str, Mapping[str, Sequence[float]]], deformed_to_rest: FloatArray
) -> list[str]:
    """One step of a case. Seeds lie in the rest frame; the command line wants those of the deformed scan in its own."""
    command = [step, str(case.absolute())]
    if step != "segment":
        return command
    for name, point in seeds.get("rest", {}).items():
        command += ["--seed", _seed(name, point)]
    back = np.linalg.inv(deformed_to_rest)
    for name, point in seeds.get("deformed", {}).items():
        command += ["--deformed-seed", _seed(name, back[:3, :3] @ np.asarray(point) + back[:3, 3])]
    return command


def steps_job(commands: Sequence[Sequence[str]], folder: Path) -> Job:
    """The job that runs commands. folder : for its messages and log."""
    return Job(step_job.KIND, str(folder), options={"commands": [list(c) for c in commands]}, workers=cores())


def scans_job(sources: Mapping[str, Path], case: Path | None, folder: Path) -> Job:
    """The job that reads scans, and the labels of a case; folder : where their voxels go."""
    options = {"sources": {s: str(p) for s, p in sources.items()}, "case": None if case is None else str(case)}
    return Job(read_scans.KIND, str(folder), options=options, workers=cores())


def _seed(name: str, point: Sequence[float] | FloatArray) -> str:
    return f"{name}={','.join(f'{float(x):.3f}' for x in point)}"
