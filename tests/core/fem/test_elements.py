"""Every element: exactness of its tables, patch test, rigid rotation, residual and tangent as derivatives of the energy."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.elements import ELEMENTS, quadrature, shape_functions, shape_gradients
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box, with_regions
from palpate.core.fem.newton.newton import NewtonOptions, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, mooney_rivlin_parameters

NAMES = sorted(ELEMENTS)
STIFF = Material(MOONEY_RIVLIN, mooney_rivlin_parameters(40.0, 4000.0))
TIGHT = NewtonOptions(rtol=2e-14)


def test_an_unknown_element_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="element 'p7' is unknown; choose one of p1"):
        Space.of(box([1, 1, 1], (1, 1, 1)), "p7")


@pytest.mark.parametrize("degree", [1, 2])
def test_shape_functions_reproduce_polynomials_of_their_degree(degree: int) -> None:
    x = np.random.default_rng(0).dirichlet(np.ones(4), size=20)[:, 1:]
    corners = np.vstack([np.zeros(3), np.eye(3)])
    nodes = (
        corners
        if degree == 1
        else np.vstack([corners, corners[[[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]]].mean(1)])
    )

    def f(p: np.ndarray) -> np.ndarray:
        linear = 1.0 + p @ np.array([2.0, -3.0, 5.0])
        return linear if degree == 1 else linear + p[:, 0] * p[:, 1] - 2.0 * p[:, 2] ** 2

    h = 1e-6
    np.testing.assert_allclose(shape_functions(degree, x) @ f(nodes), f(x), atol=1e-13)
    for i in range(3):
        numeric = (f(x + h * np.eye(3)[i]) - f(x - h * np.eye(3)[i])) / (2 * h)
        np.testing.assert_allclose(shape_gradients(degree, x)[:, :, i] @ f(nodes), numeric, atol=1e-8)


@pytest.mark.parametrize("degree", [1, 2, 5])
def test_quadrature_is_exact_to_its_degree(degree: int) -> None:
    """Mean of x^a y^b z^c over the reference cell: 6 a! b! c! / (a + b + c + 3)!."""
    from math import factorial as f

    points, weights = quadrature(degree)
    for a in range(degree + 1):
        for b in range(degree + 1 - a):
            for c in range(degree + 1 - a - b):
                exact = 6.0 * f(a) * f(b) * f(c) / f(a + b + c + 3)
                assert weights @ np.prod(points ** np.array([a, b, c]), axis=1) == pytest.approx(exact, rel=1e-12)


def on_boundary(space: Space) -> np.ndarray:
    """(n,) nodes on the surface of an axis-aligned box."""
    low, high = space.nodes.min(axis=0), space.nodes.max(axis=0)
    return (np.isclose(space.nodes, low) | np.isclose(space.nodes, high)).any(axis=1)


@pytest.mark.parametrize("law", ["mooney-rivlin", "linear"])
@pytest.mark.parametrize("name", NAMES)
def test_patch_test(name: str, law: str) -> None:
    """A constant strain prescribed on the surface of an irregular mesh is found again inside, to round-off."""
    space = Space.of(box([10.0, 8.0, 6.0], (3, 4, 3), jitter=0.2, seed=3), name)
    gradient = np.array([[0.12, 0.05, -0.02], [-0.03, -0.08, 0.10], [0.04, 0.01, 0.06]])
    exact = space.nodes @ gradient.T
    free = np.repeat(~on_boundary(space), 3)
    material = STIFF if law == "mooney-rivlin" else Material(LINEAR, np.array([40.0, 4000.0]))
    found = solve_equilibrium(Assembler(space, free), {1: material}, exact.ravel(), options=TIGHT)
    assert found.converged, found.reason
    assert np.abs(found.u - exact).max() < 1e-12 * np.abs(exact).max()
    if space.n_pressures:
        g = np.linalg.det(np.eye(3) + gradient) - 1.0 if law == "mooney-rivlin" else np.trace(gradient)
        np.testing.assert_allclose(found.p, 4000.0 * g, rtol=1e-10)


@pytest.mark.parametrize("name", NAMES)
def test_a_quarter_turn_stores_no_energy(name: str) -> None:
    space = Space.of(box([10.0, 8.0, 6.0], (2, 3, 2), jitter=0.2, seed=4), name)
    R = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]) @ np.array(
        [[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]]
    )
    turned = space.nodes @ R.T - space.nodes + np.array([5.0, -3.0, 2.0])
    assembler = Assembler(space, np.ones(3 * space.n_nodes, dtype=bool))
    assembler.set_materials({1: STIFF})
    stiffness = 40.0 * space.mesh.volumes.sum()  # energy of a strain of order one
    residual = assembler.residual(State(turned, np.zeros(space.n_pressures)), 1.0)
    assert abs(assembler.energy(turned, 1.0)) < 1e-12 * stiffness
    assert np.abs(residual.r_u).max() < 1e-12 * stiffness / 6.0
    assert np.abs(residual.r_p).max(initial=0.0) < 1e-12 * space.mesh.volumes.sum()


@pytest.mark.parametrize("name", NAMES)
def test_the_residual_is_the_gradient_of_the_energy(name: str) -> None:
    """With the pressure in balance, dE/du by finite differences, two laws in one mesh."""
    mesh = with_regions(box([4.0, 4.0, 4.0], (2, 2, 2), jitter=0.2), lambda x: np.where(x[:, 0] > 2.0, 1, 3))
    space = Space.of(mesh, name)
    assembler = Assembler(space, np.ones(3 * space.n_nodes, dtype=bool))
    assembler.set_materials({1: STIFF, 3: Material(LINEAR, np.array([20.0, 300.0]))})
    rng = np.random.default_rng(1)
    u, d = (s * rng.normal(size=space.nodes.shape) for s in (0.04, 1.0))
    residual = assembler.residual(State(u, assembler.balanced_pressure(u)), 1.0)
    h = 1e-3
    weights = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
    slope = (
        sum(w * (assembler.energy(u + k * h * d, 1.0) - assembler.energy(u - k * h * d, 1.0)) for k, w in weights) / h
    )
    assert residual.r_u @ d.ravel() == pytest.approx(slope, rel=1e-8)
    assert np.abs(residual.r_p).max(initial=0.0) < 1e-10


@pytest.mark.parametrize("name", NAMES)
def test_the_tangent_is_the_derivative_of_the_residual(name: str) -> None:
    mesh = with_regions(box([4.0, 4.0, 4.0], (2, 1, 2), jitter=0.2), lambda x: np.where(x[:, 0] > 2.0, 1, 3))
    space = Space.of(mesh, name)
    n = 3 * space.n_nodes
    rng = np.random.default_rng(2)
    free = rng.random(n) < 0.8
    assembler = Assembler(space, free)
    assembler.set_materials({1: STIFF, 3: Material(LINEAR, np.array([20.0, 300.0]))})
    u, p = 0.04 * rng.normal(size=space.nodes.shape), rng.normal(size=space.n_pressures)
    d = rng.normal(size=n + space.n_pressures)
    values, coupling = assembler.tangent(State(u, p), 1.0, np.where(free, 0.0, d[:n]))
    upper = assembler.pattern.matrix(values).toarray()
    full = upper + np.triu(upper, 1).T

    def residual(s: float) -> np.ndarray:
        r = assembler.residual(State(u + s * d[:n].reshape(-1, 3), p + s * d[n:]), 1.0)
        return np.concatenate([r.r_u, r.r_p])[assembler.kept]

    h = 1e-3
    weights = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
    numeric = sum(w * (residual(k * h) - residual(-k * h)) for k, w in weights) / h
    analytic = full @ d[assembler.kept] + coupling
    assert np.abs(analytic - numeric).max() < 1e-7 * np.abs(numeric).max()
