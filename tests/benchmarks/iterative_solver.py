"""Direct and iterative solver side by side: ``python tests/benchmarks/iterative_solver.py --cells 5000 20000``.

The scene is that of `palpate bench` (a nearly incompressible sphere in a cube, default element). Printed for each size and solver:
processor seconds of one equilibrium with its certificate, of one further solve to round-off, and of a factor; then how far the two
equilibria are apart, over the largest displacement.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import NewtonOptions, solve_equilibrium
from palpate.core.fem.scenes import sphere_scene, standard_sphere_mesh
from palpate.core.fem.state import State
from palpate.core.worker.executors import one_thread
from palpate.validate.bench.scene_file import BenchScene

T = TypeVar("T")


def main() -> None:
    """Prints a line for each size and solver."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[5000, 20000])
    parser.add_argument("--solvers", nargs="+", default=["pardiso", "iterative"])
    args = parser.parse_args()
    one_thread()
    for cells in args.cells:
        found = [one(cells, name) for name in args.solvers]
        for u in found[1:]:
            print(f"apart by {np.abs(u - found[0]).max() / np.abs(u).max():.1e}", flush=True)


def one(cells: int, solver: str) -> FloatArray:
    """Prints a line; the displacements (n, 3) mm."""
    scene = BenchScene(cells, "p2p1")
    built = sphere_scene(standard_sphere_mesh(cells), "p2p1", scene.ratio, scene.drive, solver)
    options = NewtonOptions(rtol=1e-10)
    solve_equilibrium(built.assembler, scene.materials, built.prescribed, options=options)  # compiles
    seconds, found = timed(
        lambda: solve_equilibrium(built.assembler, scene.materials, built.prescribed, options=options)
    )
    assert found.converged, found.reason
    b = np.random.default_rng(0).normal(size=len(built.assembler.kept))
    more, _ = timed(lambda: found.tangent.solve(b))
    values = built.assembler.tangent(State(found.u, found.p), 1.0)[0]
    factor, _ = timed(lambda: built.assembler.solver.factorise(values))
    print(
        f"{solver:10} {len(b):7} unknowns: equilibrium {seconds:.2f} s ({found.factorisations} matrices, {found.backsolves} "
        f"solves), one more solve {more:.2f} s, a new matrix {factor:.2f} s",
        flush=True,
    )
    return found.u


def timed(do: Callable[[], T]) -> tuple[float, T]:
    """Processor seconds, and what was found."""
    start = time.process_time()
    found = do()
    return time.process_time() - start, found


if __name__ == "__main__":
    main()
