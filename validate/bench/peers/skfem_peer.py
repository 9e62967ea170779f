"""scikit-fem as a bench child: forms written with numpy, as its hyperelasticity example does. "pardiso" swaps the linear solver."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, TypedDict

import numpy as np
import scipy.sparse as sp
import skfem
from protocol import Arrays, FloatArray, IntArray, Solver, serve
from scipy.spatial import cKDTree
from skfem.helpers import ddot, grad, mul, transpose

if TYPE_CHECKING:
    from skfem.assembly.form.form import FormExtraParams
    from skfem.element.discrete_field import DiscreteField

MAX_ITERATIONS = 30


def kinematics(F: FloatArray) -> tuple[FloatArray, FloatArray]:
    J = (
        F[0, 0] * (F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1])
        - F[0, 1] * (F[1, 0] * F[2, 2] - F[1, 2] * F[2, 0])
        + F[0, 2] * (F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0])
    )
    iFT = np.moveaxis(np.linalg.inv(np.moveaxis(F, (0, 1), (-1, -2))), (-2, -1), (0, 1))
    return J, iFT


def iso_stress(F: FloatArray, iFT: FloatArray, J: FloatArray, G: FloatArray) -> FloatArray:
    return G * J ** (-2 / 3) * (F - ddot(F, F) / 3 * iFT)


@skfem.LinearForm
def internal(v: DiscreteField, w: FormExtraParams) -> FloatArray:
    return ddot(w["P"], grad(v))


@skfem.BilinearForm
def stiffness(u: DiscreteField, v: DiscreteField, w: FormExtraParams) -> FloatArray:
    """Derivative of the stress; `p` and `dp` are d(volumetric energy)/dJ and its derivative in J."""
    H, F, iFT, J, G = grad(u), w["F"], w["iFT"], w["J"], w["G"]
    t, I1 = ddot(iFT, H), ddot(F, F)
    turned = mul(mul(iFT, transpose(H)), iFT)
    iso = H - 2 / 3 * t * F - 2 / 3 * ddot(F, H) * iFT + 2 / 9 * I1 * t * iFT + I1 / 3 * turned
    volumetric = (w["dp"] * J + w["p"]) * J * t * iFT - w["p"] * J * turned
    return ddot(G * J ** (-2 / 3) * iso + volumetric, grad(v))


@skfem.BilinearForm
def coupling(u: DiscreteField, q: DiscreteField, w: FormExtraParams) -> FloatArray:
    return q * w["J"] * ddot(w["iFT"], grad(u))


@skfem.BilinearForm
def compliance(p: DiscreteField, q: DiscreteField, w: FormExtraParams) -> FloatArray:
    return -p * q / w["K"]


@skfem.LinearForm
def volume(q: DiscreteField, w: FormExtraParams) -> FloatArray:
    return q * (w["J"] - 1.0 - w["pressure"] / w["K"])


class Problem:
    """Bases, constrained unknowns and one Newton system."""

    def __init__(self, scene: Arrays) -> None:
        corners, cells = int(scene["corners"]), scene["cells"][:, :4]
        mesh = skfem.MeshTet(scene["nodes"][:corners].T, cells.T.astype(np.int64))
        degree = 2 if scene["cells"].shape[1] == 10 else 1
        element = skfem.ElementVector(skfem.ElementTetP2() if degree == 2 else skfem.ElementTetP1())
        self.basis = skfem.Basis(mesh, element, intorder=2 if degree == 2 else 1)
        if not np.array_equal(np.sort(mesh.t.T, axis=1), np.sort(cells, axis=1)):
            raise ValueError("scikit-fem has put the cells in another order")
        self.G, self.K = scene["G"][:, None], scene["K"][:, None]
        # scikit-fem numbers unknowns its own way: found again by where they are.
        _, node = cKDTree(scene["nodes"]).query(self.basis.doflocs.T)
        self.component = np.empty(self.basis.N, dtype=np.int64)
        for i, dofs in enumerate(_components(self.basis)):
            self.component[dofs] = i
        self.node = node
        self.fixed, self.prescribed, self.force = (
            scene[k][node, self.component] for k in ("fixed", "prescribed", "force")
        )
        self.n_nodes = len(scene["nodes"])
        self.pressure = _pressure_basis(mesh, scene["regions"], self.basis) if scene["mixed"] else None
        self.free = np.flatnonzero(~self.fixed)
        if self.pressure is not None:
            self.free = np.concatenate([self.free, self.basis.N + np.arange(self.pressure.N)])

    def residual(self, u: FloatArray, p: FloatArray, share: float) -> tuple[FloatArray, dict[str, FloatArray]]:
        F = np.array(grad(self.basis.interpolate(u)))
        F[[0, 1, 2], [0, 1, 2]] += 1.0
        J, iFT = kinematics(F)
        if self.pressure is None:
            pressure, slope = self.K * (J - 1.0), self.K + 0.0 * J
        else:
            pressure, slope = np.array(self.pressure.interpolate(p)), 0.0 * J
        fields = {"F": F, "iFT": iFT, "J": J, "G": self.G + 0.0 * J, "p": pressure, "dp": slope}
        P = iso_stress(F, iFT, J, self.G) + pressure * J * iFT
        r = internal.assemble(self.basis, P=P)
        self.scale = np.linalg.norm(r[self.fixed]) + np.linalg.norm(self.force)
        r = r - share * self.force
        if self.pressure is not None:
            fields["K"] = self.K + 0.0 * J
            r = np.concatenate([r, volume.assemble(self.pressure, J=J, K=fields["K"], pressure=pressure)])
        return r, fields

    def tangent(self, fields: dict[str, FloatArray]) -> sp.csr_matrix:
        K = stiffness.assemble(self.basis, **fields)
        if self.pressure is None:
            return K
        B = coupling.assemble(self.basis, self.pressure, **fields)
        C = compliance.assemble(self.pressure, **fields)
        return sp.bmat([[K, B.T], [B, C]], "csr")


def _components(basis: skfem.Basis) -> list[IntArray]:
    out = []
    for i in range(3):
        parts = [basis.nodal_dofs[i]]
        if basis.edge_dofs is not None and len(basis.edge_dofs):
            parts.append(basis.edge_dofs[i])
        out.append(np.concatenate(parts))
    return out


def _pressure_basis(mesh: skfem.MeshTet, regions: IntArray, basis: skfem.Basis) -> skfem.Basis:
    """Linear pressure, its own in every region: the same cells with the vertices of each region counted apart."""
    _, number = np.unique(regions, return_inverse=True)
    keys = number[None, :] * mesh.p.shape[1] + mesh.t
    unique, t = np.unique(keys, return_inverse=True)
    opened = skfem.MeshTet(mesh.p[:, unique % mesh.p.shape[1]], t.reshape(mesh.t.shape), sort_t=False)
    return skfem.Basis(opened, skfem.ElementTetP1(), quadrature=basis.quadrature)


class _Linear(TypedDict, total=False):
    solver: Callable[..., FloatArray]


def load(scene: Arrays) -> Solver:
    problem = Problem(scene)
    linear: _Linear = {}
    if "pardiso" in sys.argv:
        import pypardiso

        linear["solver"] = lambda A, b, **_: pypardiso.spsolve(A.tocsr(), b)

    def newton(u: FloatArray, p: FloatArray, share: float, rtol: float) -> tuple[FloatArray, FloatArray, int]:
        for k in range(MAX_ITERATIONS):
            r, fields = problem.residual(u, p, share)
            free_r = np.linalg.norm(r[problem.free])
            if not np.isfinite(free_r):
                raise ArithmeticError("the residual is not finite: a cell was inverted")
            if k and free_r <= rtol * problem.scale:
                return u, p, k
            move = np.zeros(len(r))
            move[: len(u)][problem.fixed] = (share * problem.prescribed - u)[problem.fixed]
            d = skfem.solve(*skfem.condense(problem.tangent(fields), -r, x=move, I=problem.free), **linear)
            u, p = u + d[: len(u)], p + d[len(u) :]
        raise ArithmeticError(f"no convergence in {MAX_ITERATIONS} iterations")

    def solve(steps: int, rtol: float) -> tuple[FloatArray, int]:
        u = np.zeros(problem.basis.N)
        p = np.zeros(0 if problem.pressure is None else problem.pressure.N)
        iterations = 0
        for k in range(1, steps + 1):
            u, p, n = newton(u, p, k / steps, rtol)
            iterations += n
        out = np.zeros((problem.n_nodes, 3))
        out[problem.node, problem.component] = u
        return out, iterations

    return solve


if __name__ == "__main__":
    serve(load, skfem.__version__)
