"""The whole identification beside the loop that a user would write: FElupe's equilibria inside scipy's least squares.

Two moduli of a halved sphere from the displacements of its surface, on one mesh for all, from the same start: a comparison of time at
the same optimum, not of accuracy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NotRequired, TypedDict

import numpy as np

from palpate.validate.bench.contender import Answer, Contender, ContenderSpec
from palpate.validate.bench.environment import ours_that_identifies
from palpate.validate.bench.options import BenchOptions
from palpate.validate.bench.scene_file import SceneSize, write_identification

# Whose ln G differs by more has ended elsewhere and is not compared.
SAME_OPTIMUM = 1e-3


class Identified(TypedDict):
    """One contender's identification: least seconds of the rounds, equilibria solved, ln G found; without them, and with a reason, where
    it failed. times_our_* : ratios to Palpate, None for itself."""

    reason: str
    seconds: NotRequired[float]
    cpu_seconds: NotRequired[float]
    equilibria: NotRequired[int]
    ln_G: NotRequired[list[float]]
    times_our_seconds: NotRequired[float]
    times_our_cpu_seconds: NotRequired[float]


class IdentificationTable(TypedDict):
    """All contenders on one scene. times_faster_than_fastest_peer : of those at the same optimum; None where there is none."""

    cells: int
    unknowns: int
    palpate: Identified
    peers: dict[str, Identified]
    times_faster_than_fastest_peer: float | None


def identification(
    peers: Sequence[ContenderSpec], options: BenchOptions, folder: Path, tell: Callable[[float, str], None]
) -> IdentificationTable:
    """Every contender's least seconds of some rounds, after a first one that does not count."""
    path = folder / "identification.npz"
    size: SceneSize = write_identification(path)
    specs = [ours_that_identifies(), *peers]
    found: dict[str, Identified] = {}
    for k, spec in enumerate(specs):
        tell(k / len(specs), f"identification by {spec.name}")
        found[spec.name] = _measured(spec, path, options, folder)
    own = found.pop(specs[0].name)
    times = [_compare(own, other) for other in found.values()]
    compared = [t for t in times if t is not None]
    return {
        "cells": size.cells,
        "unknowns": size.unknowns,
        "palpate": own,
        "peers": found,
        "times_faster_than_fastest_peer": min(compared) if compared else None,
    }


def _measured(spec: ContenderSpec, path: Path, options: BenchOptions, folder: Path) -> Identified:
    contender = Contender.start(spec, path, options.limit_s)
    out = folder / "ln_G.npy"
    try:
        first = contender.solve(1, options.rtol, out)
        if first["reason"]:
            return {"reason": first["reason"]}
        answers: list[Answer] = [contender.solve(1, options.rtol) for _ in range(min(options.repeats, 3))]
    finally:
        contender.stop()
    good = [a for a in answers if not a["reason"]] or [first]
    return {
        "reason": "",
        "seconds": min(a["seconds"] for a in good),
        "cpu_seconds": min(a["cpu_seconds"] for a in good),
        "equilibria": first["iterations"],
        "ln_G": [float(v) for v in np.load(out)],
    }


def _compare(own: Identified, other: Identified) -> float | None:
    """Puts the ratios into `other`; that of seconds where both are at the same optimum."""
    if own["reason"] or other["reason"]:
        return None
    other["times_our_seconds"] = other["seconds"] / own["seconds"]
    other["times_our_cpu_seconds"] = other["cpu_seconds"] / own["cpu_seconds"]
    apart = np.abs(np.subtract(other["ln_G"], own["ln_G"])).max()
    return other["times_our_seconds"] if apart <= SAME_OPTIMUM else None
