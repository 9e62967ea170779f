"""FElupe as a bench child, as its documentation shows it (NeoHooke, SolidBody, newtonraphson); "pardiso" swaps the linear solver."""

from __future__ import annotations

import sys
from collections.abc import Callable

import felupe as fem
import numpy as np
import scipy.sparse as sp
from protocol import Arrays, FloatArray, IntArray, Solver, serve


def load(scene: Arrays) -> Solver:
    quadratic = scene["cells"].shape[1] == 10
    kind, make_region = ("tetra10", fem.RegionQuadraticTetra) if quadratic else ("tetra", fem.RegionTetra)

    def field_of(cells: IntArray) -> fem.FieldContainer:
        region = make_region(fem.Mesh(scene["nodes"], cells, kind))
        return fem.FieldContainer([fem.Field(region, dim=3)])

    whole = field_of(scene["cells"])
    bodies = []
    for r in np.unique(scene["regions"]):
        here = scene["regions"] == r
        law = fem.NeoHooke(mu=float(scene["G"][here][0]), bulk=float(scene["K"][here][0]))
        bodies.append(fem.SolidBody(law, field_of(scene["cells"][here])))
    fixed = scene["fixed"].ravel()
    dof0, dof1 = np.flatnonzero(fixed), np.flatnonzero(~fixed)
    loaded = np.flatnonzero(scene["force"].any(axis=1))
    load = fem.PointLoad(whole, loaded) if len(loaded) else None
    options: dict[str, Callable[[sp.csr_matrix, FloatArray], FloatArray]] = {}
    if "pardiso" in sys.argv:
        import pypardiso

        options["solver"] = pypardiso.spsolve

    def solve(steps: int, rtol: float) -> tuple[FloatArray, int]:
        field, iterations = whole.copy(), 0
        field[0].values[:] = 0.0
        for k in range(1, steps + 1):
            ext0 = (scene["prescribed"].ravel() * k / steps)[dof0]
            if load is not None:
                load.update(scene["force"][loaded] * k / steps)
            items = bodies if load is None else [*bodies, load]
            found = fem.newtonraphson(
                x0=field, items=items, dof0=dof0, dof1=dof1, ext0=ext0, tol=rtol, verbose=0, **options
            )
            field, iterations = found.x, iterations + found.iterations
        return field[0].values, iterations

    return solve


if __name__ == "__main__":
    serve(load, fem.__version__)
