"""Observed L2 rates of convergence on a manufactured nonlinear solution.

u is smooth, the body force is -Div P = -d2psi/dFdF : grad grad u, from the law's own tangent, which `test_laws` checks.
"""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.elements import ELEMENTS, quadrature, shape_functions
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box
from palpate.core.fem.newton.newton import NewtonOptions, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import PointSet
from palpate.core.fem.terms.loads import PointForce
from palpate.core.laws import NEO_HOOKEAN

RATES = {"p1": 2, "p1p1": 2, "p2": 3, "p2p0": 2, "p2p1": 3}
DIVISIONS = {"p1": (4, 8, 12), "p1p1": (4, 8, 12), "p2": (2, 4, 6), "p2p0": (4, 7, 10), "p2p1": (2, 4, 6)}
LENGTH, AMPLITUDE = 10.0, 0.6
WAVES = np.array([[1.1, 0.7, -0.6], [-0.5, 1.3, 0.8], [0.9, -0.4, 1.2]]) * np.pi / (2.0 * LENGTH)
PHASES = np.array([0.3, 1.1, -0.7])


def manufactured(X: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u (k, 3), grad u (k, 3, 3) and grad grad u (k, 3, 3, 3): u_i = A sin(w_i . X + c_i)."""
    angle = X @ WAVES.T + PHASES
    u = AMPLITUDE * np.sin(angle)
    gradient = AMPLITUDE * np.cos(angle)[:, :, None] * WAVES
    second = -AMPLITUDE * np.sin(angle)[:, :, None, None] * WAVES[:, :, None] * WAVES[:, None, :]
    return u, gradient, second


def manufactured_error(name: str, divisions: int) -> float:
    """L2 norm of the displacement error on a box of `divisions`^3 hexahedra, 6 tetrahedra each."""
    space = Space.of(box([LENGTH] * 3, (divisions,) * 3), name)
    points, weights = quadrature(5)
    N = shape_functions(space.element.degree, points)
    X = np.einsum("qa,eai->eqi", shape_functions(1, points), space.nodes[space.mesh.cells]).reshape(-1, 3)
    u, gradient, second = manufactured(X)
    material = Material(NEO_HOOKEAN, np.array([40.0, 20.0]))
    A = NEO_HOOKEAN.tangent(np.eye(3) + gradient, material.values).reshape(-1, 3, 3, 3, 3)
    force = -np.einsum("niJkL,nkLJ->ni", A, second)
    measure = (space.mesh.volumes[:, None] * weights).ravel()
    cells = np.repeat(space.cell_nodes, len(points), axis=0)
    load = PointForce(PointSet(cells, np.tile(N, (len(space.cell_nodes), 1)), measure), measure[:, None] * force)
    surface = (np.isclose(space.nodes, 0.0) | np.isclose(space.nodes, LENGTH)).any(axis=1)
    free = np.repeat(~surface, 3)
    exact = manufactured(space.nodes)[0]
    found = solve_equilibrium(
        Assembler(space, free, [load]), {1: material}, exact.ravel(), options=NewtonOptions(rtol=1e-9)
    )
    assert found.converged, found.reason
    discrete = np.einsum("qa,eai->eqi", N, found.u[space.cell_nodes]).reshape(-1, 3)
    return float(np.sqrt(measure @ ((discrete - u) ** 2).sum(axis=1)))


# Its finest mesh takes as long as all meshes of the other elements together.
SOONEST = [pytest.param(name, marks=pytest.mark.nightly) if name == "p2p0" else name for name in sorted(RATES)]


@pytest.mark.parametrize("name", SOONEST)
def test_observed_rate_of_convergence(name: str) -> None:
    divisions = np.array(DIVISIONS[name])
    errors = np.array([manufactured_error(name, n) for n in divisions])
    rates = np.log(errors[:-1] / errors[1:]) / np.log(divisions[1:] / divisions[:-1])
    assert abs(rates[-1] - RATES[name]) < 0.1, f"errors {errors}, rates {rates}"


def test_every_element_has_a_rate() -> None:
    assert set(RATES) == set(ELEMENTS)
