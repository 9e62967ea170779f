"""`palpate bench`: the whole speed table as one dictionary for JSON."""

from __future__ import annotations

import os
import platform
import tempfile
from pathlib import Path
from typing import Any

from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent
from palpate.validate.bench.environment import default_folder, find_peers
from palpate.validate.bench.equilibrium import EquilibriumTable, scenes
from palpate.validate.bench.options import BenchOptions
from palpate.validate.bench.reduced_study import reduced_study
from palpate.validate.bench.scaling import scaling
from palpate.validate.bench.workers import worker_scaling


def run_bench(options: BenchOptions | None = None, progress: Progress = silent) -> dict[str, Any]:
    """Measure speed against peers, growth with size, workers and the reduced model; keys as in the README's table.

    Nothing ends the run: a peer that is missing is in "skipped" with the reason, one that fails is in its row with its own.
    """
    options = (options or BenchOptions()).effective()
    table: dict[str, Any] = {"quick": options.quick, "rtol": options.rtol}
    load = os.getloadavg()
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as name, one_thread():
        folder = Path(name)
        if "equilibrium" in options.parts:
            table |= _equilibria(options, folder, _share(progress, 0.0, 0.6))
        if "scaling" in options.parts:
            table["scaling"] = scaling(options, folder, _share(progress, 0.6, 0.8))
        if "reduced_model" in options.parts:
            table["reduced_model"] = reduced_study(options, _share(progress, 0.8, 0.9))
    if "workers" in options.parts:
        table["workers"] = worker_scaling(options, _share(progress, 0.9, 1.0))
    return {"machine": {**machine(), "load_before": load, "load_after": os.getloadavg()}, **table}


def _equilibria(options: BenchOptions, folder: Path, tell: Progress) -> dict[str, Any]:
    tell(0.0, "looking for other solvers")
    peers, skipped = find_peers(options.peers_dir, options.peers, may_install=not options.quick)
    table, rows, chosen = EquilibriumTable(peers, options, folder), [], scenes(options)
    for k, scene in enumerate(chosen):
        tell(k / len(chosen), f"{scene.element}, {scene.cells} cells, v1/mu {scene.ratio:g}, {scene.drive}")
        rows.append(table.row(scene))
    return {"equilibrium": rows, "skipped_peers": skipped}


def _share(progress: Progress, start: float, end: float) -> Progress:
    return lambda fraction, message: progress(start + (end - start) * fraction, message)


def machine() -> dict[str, Any]:
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
