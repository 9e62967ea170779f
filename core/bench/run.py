"""`palpate bench`: the whole speed table as one dictionary for JSON."""

from __future__ import annotations

import os
import platform
import tempfile
from pathlib import Path
from typing import Any

from palpate.core.bench.environment import default_folder, find_peers
from palpate.core.bench.equilibrium import EquilibriumTable, scenes
from palpate.core.bench.options import BenchOptions
from palpate.core.bench.reduced_study import reduced_study
from palpate.core.bench.scaling import scaling
from palpate.core.bench.workers import worker_scaling
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent


def run_bench(options: BenchOptions | None = None, progress: Progress = silent) -> dict[str, Any]:
    """Measure speed against peers, growth with size, workers and the reduced model; keys as in the README's table.

    Nothing ends the run: a peer that is missing is in "skipped" with the reason, one that fails is in its row with its own.
    """
    options = (options or BenchOptions()).effective()
    load = os.getloadavg()
    progress(0.0, "looking for other solvers")
    peers, skipped = find_peers(options.peers_dir, options.peers, may_install=not options.quick)
    with tempfile.TemporaryDirectory(prefix="palpate-bench-") as name, one_thread():
        folder = Path(name)
        table = EquilibriumTable(peers, options, folder)
        rows = []
        chosen = scenes(options)
        for k, scene in enumerate(chosen):
            progress(
                0.6 * k / len(chosen), f"{scene.element}, {scene.cells} cells, v1/mu {scene.ratio:g}, {scene.drive}"
            )
            rows.append(table.row(scene))
        grown = scaling(options, folder, lambda f, m: progress(0.6 + 0.2 * f, m))
        reduced = reduced_study(options, lambda f, m: progress(0.8 + 0.1 * f, f"reduced model: {m}"))
    return {
        "machine": {**machine(), "load_before": load, "load_after": os.getloadavg()},
        "quick": options.quick,
        "rtol": options.rtol,
        "equilibrium": rows,
        "skipped_peers": skipped,
        "scaling": grown,
        "reduced_model": reduced,
        "workers": worker_scaling(options, lambda f, m: progress(0.9 + 0.1 * f, m)),
    }


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
