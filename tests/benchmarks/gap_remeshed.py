"""Does a diagnosis depend on the mesh? ``python tests/benchmarks/gap_remeshed.py CASE ... [--meshes 2] [--workers 1]``.

Each CASE is a case folder with label volumes. Copies of it are meshed with several seeds of the mesher, the usual one first, and
diagnosed; one line each says what was answered. The last line is a JSON object: in how many cases verdict and candidates (in whatever
order) are the same on all meshes.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from palpate.case.case_folder import CaseFolder
from palpate.case.steps import diagnose, mesh
from palpate.core.worker.executors import one_thread
from palpate.meshing.mesh_labels import MeshOptions


def main() -> None:
    """Prints a line a case and one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="+", type=Path)
    parser.add_argument("--meshes", type=int, default=2, help="how many meshes of every case (default %(default)s)")
    parser.add_argument("--workers", type=int, default=1, help="processes at a time (default %(default)s)")
    args = parser.parse_args()
    jobs = [(path, seed) for path in args.cases for seed in range(args.meshes)]
    with ProcessPoolExecutor(args.workers, initializer=one_thread) as pool:
        found = dict(zip(jobs, pool.map(diagnosed, *zip(*jobs, strict=True)), strict=True))
    same = {path.name: alike([found[path, seed] for seed in range(args.meshes)]) for path in args.cases}
    for (path, seed), answer in found.items():
        print(f"{path.name} mesh {seed + 1}: {answer}")
    print(json.dumps({"cases": len(same), "same": sum(same.values()), "other": [k for k, v in same.items() if not v]}))


def diagnosed(path: Path, seed: int) -> dict[str, Any]:
    """What a diagnosis of a copy of the case says on the mesh that the mesher makes of this seed."""
    with tempfile.TemporaryDirectory() as folder:
        lone = shutil.copytree(path, Path(folder) / path.name, copy_function=shutil.copyfile)
        lone.chmod(0o755)
        case = CaseFolder(lone)
        mesh.run(case, MeshOptions(seed=seed))
        found = diagnose.run(case)
    return {
        "verdict": found.verdict,
        "candidates": found.candidates,
        "p_value": round(found.gap.p_value, 3),
    }


def alike(answers: Sequence[dict[str, Any]]) -> bool:
    """Whether verdict and candidates are the same in all."""
    return len({(a["verdict"], frozenset(a["candidates"])) for a in answers}) == 1


if __name__ == "__main__":
    main()
