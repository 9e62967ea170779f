"""Does every particle end in a stable equilibrium, or in a reason? Thousands of random scenes, one after another."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass

import numpy as np

from palpate.core.fem.newton import NewtonOptions
from palpate.core.fem.scenes import Scene
from palpate.core.laws.base import FloatArray
from palpate.core.validate.random_scenes import random_scene
from palpate.core.worker.progress import Progress, silent

Row = dict[str, str | float | int | bool]


@dataclass(frozen=True)
class RobustnessOptions:
    """n scenes of seeds seed, seed + 1, ...; a solve that takes longer than `slow_s` is counted as hanging."""

    n: int = 10_000
    seed: int = 0
    slow_s: float = 60.0


def solve_one(seed: int) -> Row:
    """One random scene: its description, and `converged`, `finite`, `raised`, `reason`, `factorisations`, `seconds`."""
    random = random_scene(seed)
    scene = random.scene
    row: Row = dict(random.description)
    began = time.perf_counter()
    try:
        found = scene.solve(NewtonOptions(), random.start)
    except (
        ArithmeticError
    ) as error:  # what numerics may raise by mistake; a programming error should still end the study
        return row | {"converged": False, "finite": True, "raised": True, "reason": str(error), "factorisations": 0}
    return row | {
        "converged": found.converged,
        "finite": bool(np.isfinite(found.u).all() and np.isfinite(found.p).all()),
        "raised": False,
        "reason": found.reason,
        "factorisations": found.factorisations,
        "load_steps": found.load_steps,
        "largest_mm": float(np.abs(found.u).max()),
        "strain95": _strain(scene, found.u),
        "min_jacobian": float(min(found.min_jacobian, 1e300)),
        "seconds": time.perf_counter() - began,
    }


def _strain(scene: Scene, u: FloatArray) -> float:
    """95th percentile over the quadrature points of the largest |principal stretch - 1|."""
    stretches = np.linalg.svd(scene.assembler.deformation_gradients(u), compute_uv=False)
    return float(np.percentile(np.abs(stretches - 1.0).max(axis=-1), 95))


def robustness(options: RobustnessOptions | None = None, progress: Progress = silent) -> dict[str, object]:
    """Run the study; returns `share_converged`, counts and the rows of all failures."""
    options = options or RobustnessOptions()
    rows = []
    for k in range(options.n):
        rows.append(solve_one(options.seed + k))
        if k % 50 == 0:
            progress(k / options.n, f"{k} scenes, {sum(not r['converged'] for r in rows)} without equilibrium")
    failed = [r for r in rows if not r["converged"]]
    seconds = np.array([float(r.get("seconds", 0.0)) for r in rows])
    return {
        "study": "robustness",
        "scenes": options.n,
        "seed": options.seed,
        "share_converged": 1.0 - len(failed) / options.n,
        "not_finite": sum(not r["finite"] for r in rows),
        "raised": sum(bool(r["raised"]) for r in rows),
        "hanging": int((seconds > options.slow_s).sum()),
        "failed_without_reason": sum(r["reason"] == "" for r in failed),
        "by_element": dict(Counter(str(r["element"]) for r in failed)),
        "by_load": dict(Counter(str(r["load"]) for r in failed)),
        "strain95_median_and_largest": [
            float(v) for v in np.percentile([float(r.get("strain95", 0.0)) for r in rows], [50, 100])
        ],
        "mean_factorisations": float(np.mean([float(r["factorisations"]) for r in rows])),
        "seconds_total": float(seconds.sum()),
        "seconds_longest": float(seconds.max()),
        "failures": failed,
    }
