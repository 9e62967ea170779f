"""Cost and memory against the number of cells, with fitted exponents."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NotRequired, TypedDict

import numpy as np

from palpate.validate.bench.contender import Contender
from palpate.validate.bench.environment import ours
from palpate.validate.bench.options import BenchOptions
from palpate.validate.bench.scene_file import BenchScene, write_scene

SMALLEST = 200  # cells of the scene whose memory is the program's own


class _Size(TypedDict):
    cells: int
    unknowns: int
    setup_seconds: float | None


class Cost(_Size):
    """What one size costs; without seconds, and with a reason, where it was not solved."""

    reason: NotRequired[str]
    seconds: NotRequired[float]
    cpu_seconds: NotRequired[float]
    memory_mb: float | None


class Exponents(TypedDict):
    """Of growth with the number of cells; memory's is that of what is above the program's own. None : too few sizes."""

    seconds_exponent: float | None
    cpu_seconds_exponent: float | None
    memory_exponent: float | None


class Growth(Exponents):
    """One element at every size."""

    rows: list[Cost]


class Scaling(TypedDict):
    """Every element's growth, and the memory (MB) of the program itself."""

    program_memory_mb: float | None
    elements: dict[str, Growth]


def scaling(options: BenchOptions, folder: Path, tell: Callable[[float, str], None]) -> Scaling:
    """Cost of every element at every size, and exponents fitted to it."""
    base = _measure(BenchScene(SMALLEST, "p1", options.costly_ratio), options, folder)["memory_mb"]
    jobs = [(e, n) for e in options.scaling_elements for n in options.scaling_sizes]
    rows: dict[str, list[Cost]] = {e: [] for e in options.scaling_elements}
    for k, (element, cells) in enumerate(jobs):
        tell(k / len(jobs), f"cost and memory: {element}, {cells} cells")
        rows[element].append(_measure(BenchScene(cells, element, options.costly_ratio), options, folder))
    return {
        "program_memory_mb": base,
        "elements": {e: {"rows": r, **_exponents(r, base)} for e, r in rows.items()},
    }


def _measure(scene: BenchScene, options: BenchOptions, folder: Path) -> Cost:
    """One fresh process: set-up, a warm-up solve, then two or more that count."""
    path = folder / "scaling.npz"
    size = write_scene(scene, path)
    contender = Contender.start(ours(), path, options.limit_s)
    try:
        answers = [contender.solve(1, options.rtol) for _ in range(3 if scene.cells <= 20000 else 2)]
    finally:
        contender.stop()
    setup = contender.hello.get("setup_seconds")
    described: _Size = {"cells": size.cells, "unknowns": size.unknowns, "setup_seconds": setup}
    if any(a["reason"] for a in answers):
        return {**described, "reason": next(a["reason"] for a in answers if a["reason"]), "memory_mb": None}
    return {
        **described,
        "seconds": min(a["seconds"] for a in answers[1:]),
        "cpu_seconds": min(a["cpu_seconds"] for a in answers[1:]),
        "memory_mb": answers[-1]["memory_mb"],
    }


def _exponents(rows: list[Cost], base: float | None) -> Exponents:
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
