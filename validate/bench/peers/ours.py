"""Palpate as a bench child: cold solves of one scene, without the stability certificate that no peer gives ("certify" adds it)."""

from __future__ import annotations

import sys

import numpy as np

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import NewtonOptions, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.terms.loads import nodal_force
from palpate.core.laws import NEO_HOOKEAN
from palpate.core.mesh import TetMesh
from palpate.validate.bench.peers.protocol import Arrays, FloatArray, Solver, serve


def load(scene: Arrays) -> Solver:
    """Symbolic work once, as for every peer."""
    certify = "certify" in sys.argv
    corners = int(scene["corners"])
    mesh = TetMesh(scene["nodes"][:corners], scene["cells"][:, :4], scene["regions"])
    space = Space.of(mesh, str(scene["element"]))
    assert np.array_equal(space.cell_nodes, scene["cells"])
    loaded = np.flatnonzero(scene["force"].any(axis=1))
    terms = [nodal_force(loaded, scene["force"][loaded])] if len(loaded) else []
    assembler = Assembler(space, ~scene["fixed"].ravel(), terms)
    regions = scene["regions"]
    values = np.column_stack([scene["G"], scene["K"]])
    materials = {int(r): Material(NEO_HOOKEAN, values[regions == r][0]) for r in np.unique(regions)}
    prescribed = scene["prescribed"].ravel()

    def solve(steps: int, rtol: float) -> tuple[FloatArray, int]:
        options = NewtonOptions(rtol=rtol, stability=certify)
        found = solve_equilibrium(assembler, materials, prescribed, options=options)
        if not found.converged:
            raise ArithmeticError(found.reason)
        return found.u, found.factorisations

    return solve


if __name__ == "__main__":
    serve(load, "")
