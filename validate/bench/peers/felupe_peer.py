"""FElupe as a bench child, as its documentation shows it (NeoHooke, SolidBody, newtonraphson); "pardiso" swaps the linear solver."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping

import felupe as fem
import numpy as np
import scipy.sparse as sp
from protocol import Arrays, FloatArray, IntArray, Solver, serve

# region -> G and K, kPa; field to start from, None for rest; load steps; relative residual -> displacements (n, 3) mm, iterations
SolveWith = Callable[[Mapping[int, tuple[float, float]], FloatArray | None, int, float], tuple[FloatArray, int]]


def load(scene: Arrays) -> Solver:
    """One equilibrium from rest with the scene's moduli."""
    solve_with = prepare(scene)
    regions = scene["regions"]
    moduli = {
        int(r): (float(scene["G"][regions == r][0]), float(scene["K"][regions == r][0])) for r in np.unique(regions)
    }
    return lambda steps, rtol: solve_with(moduli, None, steps, rtol)


def prepare(scene: Arrays) -> SolveWith:
    """What does not change with the moduli, made once."""
    quadratic = scene["cells"].shape[1] == 10
    kind, make_region = ("tetra10", fem.RegionQuadraticTetra) if quadratic else ("tetra", fem.RegionTetra)

    def field_of(cells: IntArray) -> fem.FieldContainer:
        region = make_region(fem.Mesh(scene["nodes"], cells, kind))
        return fem.FieldContainer([fem.Field(region, dim=3)])

    whole = field_of(scene["cells"])
    parts = {int(r): field_of(scene["cells"][scene["regions"] == r]) for r in np.unique(scene["regions"])}
    fixed = scene["fixed"].ravel()
    dof0, dof1 = np.flatnonzero(fixed), np.flatnonzero(~fixed)
    loaded = np.flatnonzero(scene["force"].any(axis=1))
    load = fem.PointLoad(whole, loaded) if len(loaded) else None
    options: dict[str, Callable[[sp.csr_matrix, FloatArray], FloatArray]] = {}
    if "pardiso" in sys.argv:
        import pypardiso

        options["solver"] = pypardiso.spsolve

    def solve_with(
        moduli: Mapping[int, tuple[float, float]], start: FloatArray | None, steps: int, rtol: float
    ) -> tuple[FloatArray, int]:
        bodies = [fem.SolidBody(fem.NeoHooke(mu=G, bulk=K), parts[r]) for r, (G, K) in moduli.items()]
        items = bodies if load is None else [*bodies, load]
        field, iterations = whole.copy(), 0
        field[0].values[:] = 0.0 if start is None else start
        for k in range(1, steps + 1):
            ext0 = (scene["prescribed"].ravel() * k / steps)[dof0]
            if load is not None:
                load.update(scene["force"][loaded] * k / steps)
            found = fem.newtonraphson(
                x0=field, items=items, dof0=dof0, dof1=dof1, ext0=ext0, tol=rtol, verbose=0, **options
            )
            field, iterations = found.x, iterations + found.iterations
        return field[0].values, iterations

    return solve_with


if __name__ == "__main__":
    serve(load, fem.__version__)
