"""Cost and memory against the number of cells, with fitted exponents."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from palpate.validate.bench.contender import Contender
from palpate.validate.bench.environment import ours
from palpate.validate.bench.options import BenchOptions
from palpate.validate.bench.scene_file import BenchScene, write_scene

SMALLEST = 200  # cells of the scene whose memory is the program's own


def scaling(options: BenchOptions, folder: Path, tell: Callable[[float, str], None]) -> dict[str, Any]:
    """For each element: rows {cells, unknowns, seconds, cpu_seconds, memory_mb} and exponents.

    Memory's is that of what is above the program's own.
    """
    base = _measure(BenchScene(SMALLEST, "p1", options.costly_ratio), options, folder)["memory_mb"]
    jobs = [(e, n) for e in options.scaling_elements for n in options.scaling_sizes]
    rows: dict[str, list[dict[str, Any]]] = {e: [] for e in options.scaling_elements}
    for k, (element, cells) in enumerate(jobs):
        tell(k / len(jobs), f"cost and memory: {element}, {cells} cells")
        rows[element].append(_measure(BenchScene(cells, element, options.costly_ratio), options, folder))
    return {
        "program_memory_mb": base,
        "elements": {e: {"rows": r, **_exponents(r, base)} for e, r in rows.items()},
    }


def _measure(scene: BenchScene, options: BenchOptions, folder: Path) -> dict[str, Any]:
    """One fresh process: set-up, a warm-up solve, then two or more that count."""
    path = folder / "scaling.npz"
    size = write_scene(scene, path)
    contender = Contender.start(ours(), path, options.limit_s)
    try:
        answers = [contender.solve(1, options.rtol) for _ in range(3 if scene.cells <= 20000 else 2)]
    finally:
        contender.stop()
    row: dict[str, Any] = {"cells": size.cells, "unknowns": size.unknowns}
    row["setup_seconds"] = contender.hello.get("setup_seconds")
    if any(a["reason"] for a in answers):
        return {**row, "reason": next(a["reason"] for a in answers if a["reason"]), "memory_mb": None}
    row["seconds"] = min(a["seconds"] for a in answers[1:])
    row["cpu_seconds"] = min(a["cpu_seconds"] for a in answers[1:])
    row["memory_mb"] = answers[-1]["memory_mb"]
    return row


def _exponents(rows: list[dict[str, Any]], base: float | None) -> dict[str, float | None]:
    good = [r for r in rows if "seconds" in r]
    own = [] if base is None else [(r["cells"], r["memory_mb"] - base) for r in good if r["memory_mb"]]
    return {
        "seconds_exponent": fitted_exponent([(r["cells"], r["seconds"]) for r in good]),
        "cpu_seconds_exponent": fitted_exponent([(r["cells"], r["cpu_seconds"]) for r in good]),
        "memory_exponent": fitted_exponent([(n, m) for n, m in own if m > 0.0]),
    }


def fitted_exponent(points: list[tuple[float, float]]) -> float | None:
    """Slope of log y over log x by least squares; None from fewer than two points."""
    if len(points) < 2:
        return None
    x, y = np.log(np.array(points, dtype=float)).T
    return float(np.polyfit(x, y, 1)[0])
