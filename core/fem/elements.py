"""Tetrahedral elements as tables: displacement and pressure shape functions at quadrature points of the reference cell.

p1     linear displacement only (the paper's element): locks when v1 / mu is large.
p1p1   linear displacement, linear pressure, stabilised by polynomial pressure projection (Dohrmann & Bochev 2004,
       Int. J. Numer. Meth. Fluids 46:183): the low-order locking-free element.
p2     quadratic displacement only.
p2p0   quadratic displacement, one constant pressure per cell.
p2p1   quadratic displacement, continuous linear pressure (Taylor-Hood).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray

# The least time to 1 % error (`palpate validate forward`).
DEFAULT_ELEMENT = "p2p1"

# Local edges of a cell in the order of the quadratic element's nodes 4 to 9.
EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])


@dataclass(frozen=True, eq=False)
class Element:
    """Tables of one element on the reference tetrahedron with vertices 0, e1, e2, e3.

    name : as above. degree : 1 or 2, of the displacement. pressure : "none", "cell" or "vertex".
    points : (q, 3), weights : (q,) that sum to 1 (multiply by the cell's volume).
    N : (q, n) displacement shape functions; dN : (q, n, 3) their reference gradients.
    Np : (q, np) pressure shape functions (np = 0, 1 or 4).
    mass : (np, np) integral of Np Np^T over a cell of unit volume.
    stabilisation : (np, np) or zeros; times volume * alpha / G it is added to the pressure block.
    """

    name: str
    degree: int
    pressure: str
    points: FloatArray
    weights: FloatArray
    N: FloatArray
    dN: FloatArray
    Np: FloatArray
    mass: FloatArray
    stabilisation: FloatArray

    @property
    def n_nodes(self) -> int:
        """Displacement nodes per cell."""
        return self.N.shape[1]

    @property
    def n_pressures(self) -> int:
        """Pressure unknowns per cell."""
        return self.Np.shape[1]


def barycentric(points: FloatArray) -> FloatArray:
    """(q, 4) barycentric coordinates of reference points (q, 3)."""
    return np.column_stack([1.0 - points.sum(axis=1), points])


def shape_functions(degree: int, points: FloatArray) -> FloatArray:
    """Displacement shape functions (q, 4 or 10) at reference points (q, 3)."""
    L = barycentric(points)
    if degree == 1:
        return L
    return np.column_stack([L * (2.0 * L - 1.0), 4.0 * L[:, EDGES[:, 0]] * L[:, EDGES[:, 1]]])


def shape_gradients(degree: int, points: FloatArray) -> FloatArray:
    """Reference gradients (q, 4 or 10, 3) at reference points (q, 3)."""
    L = barycentric(points)
    dL = np.vstack([-np.ones(3), np.eye(3)])
    if degree == 1:
        return np.broadcast_to(dL, (len(L), 4, 3)).copy()
    a, b = EDGES[:, 0], EDGES[:, 1]
    vertex = (4.0 * L - 1.0)[:, :, None] * dL
    edge = 4.0 * (L[:, a, None] * dL[b] + L[:, b, None] * dL[a])
    return np.concatenate([vertex, edge], axis=1)


def quadrature(degree: int) -> tuple[FloatArray, FloatArray]:
    """Points (q, 3) and weights (q,) exact for polynomials of total degree 1, 2 or 5 (Keast 1986, Walkington)."""
    if degree <= 1:
        return np.full((1, 3), 0.25), np.ones(1)
    if degree == 2:
        a, b = (5.0 - np.sqrt(5.0)) / 20.0, (5.0 + 3.0 * np.sqrt(5.0)) / 20.0
        return np.array([[a, a, a], [b, a, a], [a, b, a], [a, a, b]]), np.full(4, 0.25)
    return _fourteen_points()


def _fourteen_points() -> tuple[FloatArray, FloatArray]:
    """Walkington's 14-point rule, degree 5, positive weights."""
    rows, weights = [], []
    for a, w in ((0.31088591926330060980, 0.11268792571801585080), (0.092735250310891226402, 0.073493043116361949544)):
        for k in range(4):
            L = np.full(4, a)
            L[k] = 1.0 - 3.0 * a
            rows.append(L[1:])
            weights.append(w)
    a = 0.045503704125649649492
    for i in range(4):
        for j in range(i):
            L = np.full(4, a)
            L[[i, j]] = 0.5 - a
            rows.append(L[1:])
            weights.append(0.042546020777081466438)
    return np.array(rows), np.array(weights)


def _build(name: str, degree: int, pressure: str, stabilised: bool = False) -> Element:
    points, weights = quadrature(degree)
    fine, fine_weights = quadrature(5)
    pressure_shapes = {
        "none": lambda x: np.zeros((len(x), 0)),
        "cell": lambda x: np.ones((len(x), 1)),
        "vertex": barycentric,
    }[pressure]
    Np_fine = pressure_shapes(fine)
    mass = np.einsum("q,qi,qj->ij", fine_weights, Np_fine, Np_fine)
    mean = fine_weights @ Np_fine
    projection = mass - np.outer(mean, mean) if stabilised else np.zeros_like(mass)
    return Element(
        name,
        degree,
        pressure,
        points,
        weights,
        shape_functions(degree, points),
        shape_gradients(degree, points),
        pressure_shapes(points),
        mass,
        projection,
    )


ELEMENTS = {
    e.name: e
    for e in (
        _build("p1", 1, "none"),
        _build("p1p1", 1, "vertex", stabilised=True),
        _build("p2", 2, "none"),
        _build("p2p0", 2, "cell"),
        _build("p2p1", 2, "vertex"),
    )
}
