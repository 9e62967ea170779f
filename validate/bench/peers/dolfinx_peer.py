"""DOLFINx as a bench child: UFL energy, its derivatives compiled, NewtonSolver with MUMPS."""

from __future__ import annotations

import dolfinx
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import NonlinearProblem
from dolfinx.mesh import Mesh, create_mesh
from dolfinx.nls.petsc import NewtonSolver
from mpi4py import MPI
from petsc4py import PETSc
from protocol import Arrays, FloatArray, Solver, serve
from scipy.spatial import cKDTree


def _mesh(scene: Arrays) -> Mesh:
    cell = ufl.Cell("tetrahedron", geometric_dimension=3)
    domain = ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1))
    corners = int(scene["corners"])
    return create_mesh(MPI.COMM_SELF, scene["cells"][:, :4].astype(np.int64), scene["nodes"][:corners], domain)


def _per_cell(mesh: Mesh, values: FloatArray) -> fem.Function:
    function = fem.Function(fem.FunctionSpace(mesh, ("DG", 0)))
    function.x.array[:] = values[np.asarray(mesh.topology.original_cell_index)]
    return function


def load(scene: Arrays) -> Solver:
    """Compiles the forms: set-up, not counted. Written for DOLFINx 0.5 to 0.7, where Debian stands."""
    degree = 2 if scene["cells"].shape[1] == 10 else 1
    mesh = _mesh(scene)
    V = fem.VectorFunctionSpace(mesh, ("Lagrange", degree))
    u, v = fem.Function(V), ufl.TestFunction(V)
    G, K = _per_cell(mesh, scene["G"]), _per_cell(mesh, scene["K"])
    F = ufl.Identity(3) + ufl.grad(u)
    J = ufl.det(F)
    energy = G / 2 * (J ** (-2 / 3) * ufl.tr(F.T * F) - 3) + K / 2 * (J - 1) ** 2
    dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 2 if degree == 2 else 1})
    residual = ufl.derivative(energy * dx, u, v)
    _, node = cKDTree(scene["nodes"]).query(V.tabulate_dof_coordinates())
    fixed = scene["fixed"].all(axis=1)[node]
    boundary = fem.Function(V)
    bc = fem.dirichletbc(boundary, np.flatnonzero(fixed).astype(np.int32))
    problem = _WithForces(residual, u, [bc], scene["force"][node].ravel())

    def solve(steps: int, rtol: float) -> tuple[FloatArray, int]:
        u.x.array[:] = 0.0
        iterations = 0
        for k in range(1, steps + 1):
            boundary.x.array[:] = (scene["prescribed"][node] * k / steps).ravel()
            problem.share = k / steps
            iterations += _newton(problem, rtol, u)
        out = np.empty_like(scene["nodes"])
        out[node] = u.x.array.reshape(-1, 3)
        return out, iterations

    return solve


class _WithForces(NonlinearProblem):
    """The residual less dead nodal forces."""

    def __init__(self, F: ufl.Form, u: fem.Function, bcs: list[fem.DirichletBCMetaClass], force: FloatArray) -> None:
        super().__init__(F, u, bcs)
        self.force, self.share = force, 1.0
        self.held = np.concatenate([3 * b.dof_indices()[0][:, None] // 3 for b in bcs]).ravel()

    def F(self, x: PETSc.Vec, b: PETSc.Vec) -> None:
        super().F(x, b)
        with b.localForm() as local:
            values = self.share * self.force.copy()
            values[self.held] = 0.0
            local.array[:] = local.array - values


def _newton(problem: _WithForces, rtol: float, u: fem.Function) -> int:
    solver = NewtonSolver(MPI.COMM_SELF, problem)
    solver.rtol, solver.atol, solver.max_it, solver.convergence_criterion = rtol, 1e-12, 30, "residual"
    solver.error_on_nonconvergence = True
    ksp = solver.krylov_solver
    ksp.setType(PETSc.KSP.Type.PREONLY)
    ksp.getPC().setType(PETSc.PC.Type.LU)
    ksp.getPC().setFactorSolverType("mumps")
    iterations, _ = solver.solve(u)
    return int(iterations)


if __name__ == "__main__":
    serve(load, dolfinx.__version__)
