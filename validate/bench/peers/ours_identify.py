"""Palpate's identification of moduli as a bench child: Levenberg-Marquardt with direct sensitivities, from the same start."""

from __future__ import annotations

import numpy as np

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import NewtonOptions, solve_equilibrium
from palpate.core.fem.sensitivity import direct
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.inference.gauss_newton import gauss_newton
from palpate.core.laws import NEO_HOOKEAN
from palpate.core.mesh import TetMesh
from palpate.validate.bench.peers.protocol import Arrays, FloatArray, Solver, serve

START_KPA = 30.0
LAST_STEP = 1e-4
BOUNDS_KPA = 5.0, 500.0


def load(scene: Arrays) -> Solver:
    """ln G of the unknown regions, and the number of equilibria."""
    corners = int(scene["corners"])
    mesh = TetMesh(scene["nodes"][:corners], scene["cells"][:, :4], scene["regions"])
    space = Space.of(mesh, str(scene["element"]))
    assembler = Assembler(space, ~scene["fixed"].ravel())
    regions, unknown, observed = scene["regions"], scene["unknown"], scene["observed"]
    known = {int(r): np.array([scene["G"][regions == r][0], scene["K"][regions == r][0]]) for r in np.unique(regions)}
    bounds = np.log(np.tile(BOUNDS_KPA, (len(unknown), 1)))

    def solve(steps: int, rtol: float) -> tuple[FloatArray, int]:
        last: State | None = None

        def linearise(ln_G: FloatArray) -> tuple[FloatArray, FloatArray] | None:
            nonlocal last
            moduli = {int(r): np.array([np.exp(v), known[int(r)][1]]) for r, v in zip(unknown, ln_G, strict=True)}
            materials = {r: Material(NEO_HOOKEAN, values) for r, values in (known | moduli).items()}
            found = solve_equilibrium(assembler, materials, scene["prescribed"].ravel(), last, NewtonOptions(rtol=rtol))
            if not found.converged:
                return None
            last = State(found.u, found.p)
            rates = direct(found.tangent, [{r: np.array([values[0], 0.0])} for r, values in moduli.items()])
            J = rates[:, observed].reshape(len(unknown), -1).T
            return (found.u[observed] - scene["measured"]).ravel(), J

        end = gauss_newton(linearise, np.full(len(unknown), np.log(START_KPA)), bounds, LAST_STEP)
        if end is None:
            raise ArithmeticError("the start cannot be solved")
        return end.theta, end.evaluations

    return solve


if __name__ == "__main__":
    serve(load, "")
