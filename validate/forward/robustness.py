"""Does every particle end in a stable equilibrium, or in a reason? Thousands of random scenes, one after another."""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate import core
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.fem.newton.newton import NewtonOptions
from palpate.core.fem.scenes import Scene
from palpate.core.worker.cluster import study_executor
from palpate.core.worker.messages import encode
from palpate.core.worker.progress import Progress, silent
from palpate.validate.forward.random_scenes import random_scene

Row = dict[str, str | float | int | bool]
_CORE = Path(core.__file__).parent
_SCENES = tuple(Path(__file__).with_name(name) for name in ("random_scenes.py", "robustness.py"))


def code_fingerprint() -> str:
    """SHA-256 of the solver's and the scenes' source: outcomes of other code are not this code's."""
    digest = hashlib.sha256()
    for path in sorted([*(_CORE / "fem").rglob("*.py"), *(_CORE / "laws").glob("*.py"), *_SCENES]):
        digest.update(f"{path.parent.name}/{path.name}".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def read_rows(path: Path, fingerprint: str) -> dict[int, Row]:
    """Rows by seed of the same code; a last line that a kill cut short is left out. Raises InputError for an unreadable file."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({type(error).__name__}); name another file") from error
    rows: dict[int, Row] = {}
    for line in lines:
        try:
            row = json.loads(line)
        except ValueError:
            continue
        if isinstance(row, dict) and row.pop("code", None) == fingerprint and isinstance(row.get("seed"), int):
            rows[row["seed"]] = row
    return rows


def append_rows(path: Path, rows: Iterable[Row], fingerprint: str) -> None:
    """Add rows at the end, each begun on a line of its own. Raises InputError when the file cannot be written."""
    text = "".join(encode({**row, "code": fingerprint}) + "\n" for row in rows)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a+b") as stream:
            size = stream.seek(0, 2)
            if size:
                stream.seek(size - 1)
                if stream.read(1) != b"\n":  # a kill cut the last line short
                    text = "\n" + text
            stream.write(text.encode())
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose a writable place") from error


_PIECE = 50  # scenes between two looks at the clock


@dataclass(frozen=True)
class RobustnessOptions:
    """n scenes of seeds seed, seed + 1, ...; a solve of more than `slow_s` processor seconds is counted as hanging.

    log : file of outcomes; scenes that are in it are not solved again.
    workers : processes, cluster : address of a Dask scheduler instead; neither changes an outcome.
    """

    n: int = 10_000
    seed: int = 0
    slow_s: float = 60.0
    log: Path | None = None
    workers: int = 1
    cluster: str | None = None


def solve_one(seed: int) -> Row:
    """One random scene: its description, and `converged`, `finite`, `raised`, `reason`, `factorisations`, `seconds`."""
    random = random_scene(seed)
    scene = random.scene
    row: Row = dict(random.description)
    began = time.process_time()  # not the clock: a machine that has others to serve is no solver that hangs
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
        "buckled": found.buckled,
        "largest_mm": float(np.abs(found.u).max()),
        "strain95": _strain(scene, found.u),
        "min_jacobian": float(min(found.min_jacobian, 1e300)),
        "seconds": time.process_time() - began,
    }


def _strain(scene: Scene, u: FloatArray) -> float:
    """95th percentile over the quadrature points of the largest |principal stretch - 1|."""
    stretches = np.linalg.svd(scene.assembler.deformation_gradients(u), compute_uv=False)
    return float(np.percentile(np.abs(stretches - 1.0).max(axis=-1), 95))


def robustness(options: RobustnessOptions | None = None, progress: Progress = silent) -> dict[str, object]:
    """Run the study; returns `share_converged`, counts and the rows of all failures."""
    options = options or RobustnessOptions()
    rows: dict[int, Row] = {}
    code = code_fingerprint()
    if options.log is not None:
        rows = read_rows(options.log, code)
    wanted = range(options.seed, options.seed + options.n)
    missing = [seed for seed in wanted if seed not in rows]
    for piece in _solved(missing, options):
        rows |= {int(row["seed"]): row for row in piece}
        if options.log is not None:
            append_rows(options.log, piece, code)
        done = [rows[seed] for seed in wanted if seed in rows]
        failed = sum(not row["converged"] for row in done)
        progress(len(done) / options.n, f"{len(done)} scenes, {failed} without equilibrium")
    return summary([rows[seed] for seed in wanted], options)


def _solved(seeds: Sequence[int], options: RobustnessOptions) -> Iterator[list[Row]]:
    pieces = [seeds[k : k + _PIECE] for k in range(0, len(seeds), _PIECE)]
    with study_executor(options.workers, options.cluster) as executor:
        yield from executor.map(_solve_piece, pieces)


def _solve_piece(seeds: Sequence[int]) -> list[Row]:
    return [solve_one(seed) for seed in seeds]


def summary(rows: Sequence[Row], options: RobustnessOptions) -> dict[str, object]:
    """What the rows say together."""
    failed = [r for r in rows if not r["converged"]]
    seconds = np.array([float(r.get("seconds", 0.0)) for r in rows])
    strain = [float(r.get("strain95", 0.0)) for r in rows]
    return {
        "study": "robustness",
        "scenes": len(rows),
        "seed": options.seed,
        "share_converged": 1.0 - len(failed) / len(rows),
        "not_finite": sum(not r["finite"] for r in rows),
        "raised": sum(bool(r["raised"]) for r in rows),
        "hanging": int((seconds > options.slow_s).sum()),
        "failed_without_reason": sum(r["reason"] == "" for r in failed),
        "started_inverted": sum(r["start"] == "inverted" for r in rows),
        "buckled": sum(bool(r.get("buckled")) for r in rows),
        "by_element": dict(Counter(str(r["element"]) for r in failed)),
        "by_load": dict(Counter(str(r["load"]) for r in failed)),
        "strain95_median_and_largest": [float(v) for v in np.percentile(strain, [50, 100])],
        "mean_factorisations": float(np.mean([float(r["factorisations"]) for r in rows])),
        "seconds_total": float(seconds.sum()),
        "seconds_longest": float(seconds.max()),
        "failures": failed,
    }
