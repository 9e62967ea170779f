"""A body of quadratic tetrahedra in equilibrium, on scikit-fem: its space, quadrature and assembly; Newton with load steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pypardiso
from numpy.typing import NDArray
from scipy import sparse
from skfem import Basis, ElementTetP2, MeshTet
from skfem.assembly.form.coo_data import COOData

from palpate.core.errors import ConvergenceError
from palpate.segmentation.gap_truth.laws import Organ, Tissue

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Laws = Mapping[int, Organ | Tissue]

_TOLERANCE, _ITERATIONS, _SMALLEST_STEP = 1e-7, 14, 1.0 / 64.0


@dataclass(frozen=True, eq=False)
class Body:
    """points (v, 3) mm, cells (m, 4), regions (m,): quadratic displacement over straight-sided cells, four points a cell."""

    points: FloatArray
    cells: IntArray
    regions: IntArray

    @cached_property
    def basis(self) -> Basis:
        """scikit-fem's scalar space; a displacement has three values a node."""
        return Basis(MeshTet(self.points.T.copy(), self.cells.T.copy()), ElementTetP2(), intorder=2)

    @cached_property
    def nodes(self) -> FloatArray:
        """(n, 3) mm: corners, then mid-edges."""
        return np.ascontiguousarray(self.basis.doflocs.T)

    @cached_property
    def cell_nodes(self) -> IntArray:
        """(m, 10): corners, then the mid-edges 01, 12, 02, 03, 13, 23."""
        return np.ascontiguousarray(self.basis.element_dofs.T).astype(np.int64)

    @cached_property
    def slopes(self) -> FloatArray:
        """(m, q, 10, 3) 1/mm, gradients of the shape functions at the quadrature points."""
        grads = np.stack([b[0].grad for b in self.basis.basis])  # (10, 3, m, q)
        return np.ascontiguousarray(grads.transpose(2, 3, 0, 1))

    @cached_property
    def weights(self) -> FloatArray:
        """(m, q) mm3."""
        return np.asarray(self.basis.dx)

    def gradients(self, u: FloatArray) -> FloatArray:
        """F (m, q, 3, 3) of a displacement u (n, 3) mm."""
        return np.eye(3) + np.einsum("mai,mqaj->mqij", u[self.cell_nodes], self.slopes, optimize=True)

    def face_nodes(self, faces: IntArray) -> IntArray:
        """Nodes (f, 6) of faces (f, 3) given by corners; mid-edges in the order 01, 12, 20."""
        pairs = self.cell_nodes[:, [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]]].reshape(-1, 2)
        middle = self.cell_nodes[:, 4:].ravel()
        table = {(min(p), max(p)): n for p, n in zip(pairs.tolist(), middle.tolist(), strict=True)}
        edges = [[table[min(p), max(p)] for p in ((a, b), (b, c), (c, a))] for a, b, c in faces.tolist()]
        return np.hstack([faces, np.array(edges, dtype=np.int64).reshape(-1, 3)])

    def assemble(self, u: FloatArray, laws: Laws) -> tuple[FloatArray, sparse.csr_matrix]:
        """Internal force (3 n,) mN and its derivative (3 n, 3 n) mN/mm. Not finite where an organ's cell is turned inside out."""
        F = self.gradients(u)
        m, q = self.weights.shape
        force, stiffness = np.zeros((m, 10, 3)), np.zeros((m, 30, 30))
        for region, law in laws.items():
            here = np.flatnonzero(self.regions == region)
            P, A = law.response(F[here].reshape(-1, 3, 3))
            w, D = self.weights[here], self.slopes[here]
            P, A = P.reshape(-1, q, 3, 3) * w[..., None, None], A.reshape(-1, q, 3, 3, 3, 3)
            force[here] = np.einsum("mqaj,mqij->mai", D, P, optimize=True)
            half = np.einsum("mqaj,mqijkl->mqaikl", D, A * w[..., None, None, None, None], optimize=True)
            stiffness[here] = np.einsum("mqaikl,mqbl->maibk", half, D, optimize=True).reshape(-1, 30, 30)
        unknown = (3 * self.cell_nodes[:, :, None] + np.arange(3)).reshape(m, 30)
        size = 3 * len(self.nodes)
        total = np.bincount(unknown.ravel(), force.reshape(-1), minlength=size).astype(np.float64)
        indices = np.stack([np.repeat(unknown, 30, axis=1).ravel(), np.tile(unknown, (1, 30)).ravel()])
        return total, COOData(indices, stiffness.ravel(), (size, size), None).tocsr()


def equilibrium(
    body: Body, laws: Laws, held: FloatArray, load: FloatArray | None = None, start: FloatArray | None = None
) -> FloatArray:
    """Displacement (n, 3) mm in equilibrium; held : (n, 3) mm where prescribed, NaN where free. load : (n, 3) mN, dead.

    From `start` or from rest, the boundary going as far at a time as Newton follows. Raises ConvergenceError when there is none.
    """
    free = np.isnan(held).ravel()
    force = np.zeros(held.size) if load is None else load.ravel()
    u = np.zeros(held.size) if start is None else start.ravel().copy()
    begin, reached, step = u.copy(), 0.0, 1.0
    while reached < 1.0:
        way = min(reached + step, 1.0)
        target = np.where(free, u, begin + way * (np.nan_to_num(held.ravel()) - begin))
        found = _newton(body, laws, u, target - u, way * force if start is None else force, free)
        if found is not None:
            u, reached = found, way
            continue
        step *= 0.5
        if step < _SMALLEST_STEP:
            raise ConvergenceError("the simulated body has no equilibrium; make its walls move less")
    return u.reshape(-1, 3)


def _newton(
    body: Body, laws: Laws, u: FloatArray, jump: FloatArray, force: FloatArray, free: NDArray[np.bool_]
) -> FloatArray | None:
    """Newton's method with the held unknowns moved by `jump` in the first step; None when it does not converge."""
    solver = pypardiso.PyPardisoSolver()
    try:
        inner, K = body.assemble(u.reshape(-1, 3), laws)
        first = None
        for k in range(_ITERATIONS):
            rhs = force - inner - (K @ jump if k == 0 else 0.0)
            move = jump.copy() if k == 0 else np.zeros_like(u)
            move[free] = pypardiso.spsolve(K[free][:, free].tocsr(), rhs[free], solver=solver)
            u, inner, K = _as_far_as_allowed(body, laws, u, move, whole=k == 0)
            left = float(np.linalg.norm((force - inner)[free]))
            if not np.isfinite(left):
                return None
            first = float(np.linalg.norm(inner[~free])) if first is None else first
            if left < _TOLERANCE * max(first, 1e-9):
                return u
        return None
    finally:
        solver.free_memory(everything=True)


def _as_far_as_allowed(
    body: Body, laws: Laws, u: FloatArray, move: FloatArray, whole: bool
) -> tuple[FloatArray, FloatArray, sparse.csr_matrix]:
    """Go the whole way, or (but in the first step, which holds the boundary's motion) half of it while a cell turns inside out."""
    share = 1.0
    while True:
        there = u + share * move
        inner, K = body.assemble(there.reshape(-1, 3), laws)
        if np.isfinite(inner).all() or whole or share < 0.1:
            return there, inner, K
        share *= 0.5


def slopes_in(
    body: Body, laws: Callable[[float], Laws], u: FloatArray, held: FloatArray, step: float = 1e-3
) -> FloatArray:
    """(n, 3) mm, derivative of the equilibrium u in the parameter of `laws` at 0, by one solve with the tangent there."""
    free = np.isnan(held).ravel()
    K = body.assemble(u, laws(0.0))[1]
    change = (body.assemble(u, laws(step))[0] - body.assemble(u, laws(-step))[0]) / (2.0 * step)
    out = np.zeros(u.size)
    out[free] = pypardiso.spsolve(K[free][:, free].tocsr(), -change[free])
    return out.reshape(-1, 3)
