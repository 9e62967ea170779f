"""`palpate bench`: the whole speed table as one dictionary for JSON."""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NotRequired, TypedDict

from palpate.core.errors import InputError
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, part, silent
from palpate.validate.bench.contender import ContenderSpec
from palpate.validate.bench.environment import IDENTIFYING, default_folder, find_identifying_peers, find_peers
from palpate.validate.bench.equilibrium import EquilibriumTable, Row, scenes
from palpate.validate.bench.identification import IdentificationTable, identification
from palpate.validate.bench.options import BenchOptions
from palpate.validate.bench.reduced_study import ReducedFigures, reduced_study
from palpate.validate.bench.scaling import Scaling, scaling
from palpate.validate.bench.scene_file import BenchScene
from palpate.validate.bench.steps import StepCosts, step_costs
from palpate.validate.bench.workers import WorkerFigures, worker_scaling

_Load = tuple[float, float, float]  # averages over 1, 5 and 15 minutes


class Processor(TypedDict):
    """What the figures were measured on."""

    cpu: str
    processors: int | None
    system: str
    python: str


class Machine(Processor):
    """The same, with what else it was doing before and after."""

    load_before: _Load
    load_after: _Load


class Equilibria(TypedDict):
    """One equilibrium a row; peers that were not looked for by name and are not here, with the reason."""

    equilibrium: list[Row]
    skipped_peers: dict[str, str]


class BenchTable(TypedDict):
    """The parts that were asked for."""

    machine: Machine
    quick: bool
    rtol: float
    equilibrium: NotRequired[list[Row]]
    skipped_peers: NotRequired[dict[str, str]]
    scaling: NotRequired[Scaling]
    reduced_model: NotRequired[ReducedFigures]
    workers: NotRequired[WorkerFigures]
    identification: NotRequired[IdentificationTable]
    steps: NotRequired[StepCosts]


def run_bench(options: BenchOptions | None = None, progress: Progress = silent) -> BenchTable:
    """Measure speed against peers, growth with size, workers and the reduced model; keys as in docs/measured.md.

    A peer that has no answer on a scene is in its row with the reason; one that is not here, and was not asked for by name,
    is in "skipped_peers". InputError : a peer that was asked for by name is not here, or one that is here does not run.
    """
    options = (options or BenchOptions()).effective()
    if options.peers and not {"equilibrium", "identification"} & set(options.parts):
        raise InputError(
            f"{', '.join(options.peers)}: peers are compared in the parts equilibrium and identification alone; ask for one of these"
        )
    load = os.getloadavg()
    table: BenchTable = {
        "machine": {**machine(), "load_before": load, "load_after": load},
        "quick": options.quick,
        "rtol": options.rtol,
    }
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as name, one_thread():
        folder = Path(name)
        if "equilibrium" in options.parts:
            table |= _equilibria(options, folder, part(progress, 0.0, 0.6))
        if "scaling" in options.parts:
            table["scaling"] = scaling(options, folder, part(progress, 0.6, 0.8))
        if "reduced_model" in options.parts:
            table["reduced_model"] = reduced_study(options, part(progress, 0.8, 0.9))
        if "identification" in options.parts:
            table["identification"] = _identification(options, folder, part(progress, 0.9, 0.95))
    if "workers" in options.parts:
        table["workers"] = worker_scaling(options, part(progress, 0.95, 1.0))
    if "steps" in options.parts:
        with tempfile.TemporaryDirectory(prefix="palpate-bench-") as name:
            table["steps"] = step_costs(Path(name), progress)
    table["machine"]["load_after"] = os.getloadavg()
    return table


def _equilibria(options: BenchOptions, folder: Path, tell: Progress) -> Equilibria:
    tell(0.0, "looking for other solvers")
    peers, skipped = find_peers(options.peers_dir, options.peers, may_install=not options.quick)
    chosen = scenes(options)
    _refuse_absent_peers(options.peers or (), peers, skipped, chosen)
    table, rows = EquilibriumTable(peers, options, folder), []
    for k, scene in enumerate(chosen):
        tell(k / len(chosen), f"{scene.element}, {scene.cells} cells, v1/mu {scene.ratio:g}, {scene.drive}")
        rows.append(table.row(scene))
    return {"equilibrium": rows, "skipped_peers": skipped}


def _identification(options: BenchOptions, folder: Path, tell: Progress) -> IdentificationTable:
    """InputError where a peer that was asked for has no such loop, is not here or does not run."""
    peers, skipped = find_identifying_peers(options.peers_dir, options.peers, may_install=not options.quick)
    wanted = () if options.peers is None or "equilibrium" in options.parts else options.peers
    for name in wanted:
        if name not in IDENTIFYING:
            raise InputError(f"{name} was asked for and has no loop that identifies; choose {', '.join(IDENTIFYING)}")
        if name in skipped:
            raise InputError(f"{name} was asked for and is not here: {skipped[name]}")
    found = identification(peers, options, folder, tell)
    for name, peer in found["peers"].items():
        if wanted and peer["reason"]:
            raise InputError(f"{name} did not run: {peer['reason']}")
    return found


def _refuse_absent_peers(
    wanted: Sequence[str], peers: Sequence[ContenderSpec], skipped: Mapping[str, str], chosen: Sequence[BenchScene]
) -> None:
    """A peer that was asked for by name, and that no row would hold, ends the run before it begins."""
    elements = {scene.element for scene in chosen}
    for name in wanted:
        if name in skipped:
            raise InputError(f"{name} was asked for and is not here: {skipped[name]}")
        if not any(spec.name == name and elements & set(spec.elements) for spec in peers):
            raise InputError(
                f"{name} was asked for and has no element {' or '.join(sorted(elements))}; choose --element p1"
            )


def machine() -> Processor:
    """What the figures were measured on."""
    model = platform.processor()
    try:
        with open("/proc/cpuinfo") as cpu:
            model = next(line.split(":")[1].strip() for line in cpu if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return {
        "cpu": model,
        "processors": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
    }


__all__ = ["BenchOptions", "default_folder", "run_bench"]
