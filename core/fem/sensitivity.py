"""Direct and adjoint derivatives of an equilibrium with respect to parameters, from the factor the solve left behind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.state import State

FloatArray = NDArray[np.float64]
# Region id -> rate of change of that region's law parameters, (k,) or (cells, k), per unit of the parameter theta.
Direction = Mapping[int, FloatArray]


def factorise_at(assembler: Assembler, state: State, load: float = 1.0) -> None:
    """Factorise the tangent at an equilibrium; `solve_equilibrium` with its stability check has already done so."""
    assembler.solver.factorise(assembler.tangent(state, load)[0])


def direct(assembler: Assembler, state: State, directions: Sequence[Direction]) -> FloatArray:
    """du/dtheta (t, n, 3) mm per unit of each theta: one back-substitution each. The tangent at `state` must be factorised."""
    rhs = np.stack([-assembler.parameter_force(state, d) for d in directions], axis=1)
    n = assembler.space.n_displacements
    full = np.zeros((n + assembler.space.n_pressures, len(directions)))
    full[assembler.kept] = assembler.solver.solve(rhs)
    return full[:n].T.reshape(len(directions), -1, 3)


def adjoint(assembler: Assembler, state: State, directions: Sequence[Direction], gradient: FloatArray) -> FloatArray:
    """dPhi/dtheta (t,) of a scalar whose derivative in nodal displacements is `gradient` (n, 3): one back-substitution in all."""
    rhs = np.zeros(assembler.space.n_displacements + assembler.space.n_pressures)
    rhs[: gradient.size] = gradient.reshape(-1)
    multiplier = assembler.solver.solve(rhs[assembler.kept])
    return np.array([-float(multiplier @ assembler.parameter_force(state, d)) for d in directions])


def response_to_forces(assembler: Assembler, forces: FloatArray) -> FloatArray:
    """du/ds (r, n, 3) mm when dead nodal forces (r, n, 3) mN per unit of s act in addition. The tangent must be factorised."""
    n = assembler.space.n_displacements
    rhs = np.zeros((n + assembler.space.n_pressures, len(forces)))
    rhs[:n] = np.asarray(forces, dtype=float).reshape(len(forces), -1).T
    full = np.zeros_like(rhs)
    full[assembler.kept] = assembler.solver.solve(rhs[assembler.kept])
    return full[:n].T.reshape(len(forces), -1, 3)


def response_to_moves(assembler: Assembler, state: State, moves: FloatArray, load: float = 1.0) -> FloatArray:
    """du/ds (r, n, 3) mm when constrained unknowns move by moves (r, n, 3) mm per unit of s. The tangent must be factorised."""
    n = assembler.space.n_displacements
    held = ~assembler.free
    out = np.zeros((len(moves), n))
    for row, move in zip(out, np.asarray(moves, dtype=float).reshape(len(moves), -1), strict=True):
        along = np.where(held, move, 0.0)
        full = np.zeros(n + assembler.space.n_pressures)
        full[assembler.kept] = -assembler.solver.solve(assembler.tangent(state, load, along)[1])
        row[:] = full[:n] + along
    return out.reshape(len(moves), -1, 3)
