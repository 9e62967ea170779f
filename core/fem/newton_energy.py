"""The energy iteration: p eliminated, indefinite points projected (Teran et al. 2005), line search on E(u). Slower than the mixed
iteration, but it ends in a minimum; from an unstable equilibrium it leaves along the direction in which the energy falls.
"""

from __future__ import annotations

import numpy as np

from palpate.core.fem.assembly import Assembler, Residual, State
from palpate.core.fem.newton_mixed import Outcome, iterate_mixed
from palpate.core.fem.newton_work import FloatArray, Work, is_minimum, moved, relative

_NEAR = 1e-3  # relative residual below which the mixed iteration is given another try
_SMALLEST_SHARE = 0.05  # of the projection, once the plain matrix has failed


def minimise(
    assembler: Assembler, state: State, goal: FloatArray, load: float, work: Work, iterations: int = 60
) -> Outcome:
    """Descend on E(u) from `state`; constrained unknowns already stand at load * goal and stay there.

    The Hessian takes its pressure from the linear prediction of the last step, not from the present volume error, which a large
    bulk modulus would blow up; with any pressure the step is a descent direction, since its right-hand side is E's gradient.
    """
    u, energy = state.u, assembler.energy(state.u, load)
    pressure, near, share = state.p, _NEAR, 0.0
    for _ in range(iterations):
        balanced = State(u, assembler.balanced_pressure(u))
        residual = assembler.residual(balanced, load)
        distance = relative(assembler, residual)
        if distance <= max(near, work.options.rtol):
            near = 0.1 * distance
            found = iterate_mixed(assembler, balanced, goal, load, work)
            if found.converged and found.stable is not False:
                return found
        step, share = _descent_step(assembler, State(u, pressure), residual, load, work, share)
        if step is None:
            return Outcome(balanced, False, None, True)
        direction = moved(assembler, State(np.zeros_like(u), np.zeros_like(pressure)), 1.0, step)
        slope = float(direction.u.reshape(-1) @ residual.r_u)
        length, lower = _line_search(assembler, u, direction.u, energy, slope, load, residual.min_jacobian)
        if length == 0.0:
            work.reason = "the line search found no lower energy"
            return Outcome(balanced, False, None, True)
        u, energy = u + length * direction.u, lower
        pressure = balanced.p + length * direction.p
    work.reason = "no convergence of the energy iteration"
    return Outcome(State(u, pressure), False, None, True)


def _descent_step(
    assembler: Assembler, state: State, residual: Residual, load: float, work: Work, share: float
) -> tuple[FloatArray | None, float]:
    """Newton step of the energy over the kept unknowns, and the share of projection that its matrix needed.

    The matrix is (1 - share) plain + share projected: all of the projection shortens steps more than a minimum needs.
    """
    plain, _ = assembler.tangent(state, load)
    share = 0.0 if share < _SMALLEST_SHARE else 0.3 * share
    projected = plain
    while not work.exhausted:
        if share > 0.0 and projected is plain:
            projected, _ = assembler.tangent(state, load, project=True)
        if not work.factorise(assembler, plain if share == 0.0 else (1.0 - share) * plain + share * projected):
            return None, share
        if is_minimum(assembler) or share >= 1.0:
            return work.correction(assembler, residual), share
        share = min(1.0, max(_SMALLEST_SHARE, 3.0 * share))
    return None, share


def _line_search(
    assembler: Assembler,
    u: FloatArray,
    direction: FloatArray,
    energy: float,
    slope: float,
    load: float,
    min_jacobian: float,
) -> tuple[float, float]:
    """Armijo, with longer steps while the energy falls as the slope says: (length, energy there); length 0 when there is none."""
    if not slope < 0.0:
        return 0.0, energy
    floor, noise = 0.05 * min(min_jacobian, 1.0), 1e-14 * max(abs(energy), 1.0)

    def energy_at(length: float) -> float:
        trial = u + length * direction
        return assembler.energy(trial, load) if assembler.min_jacobian(trial) > floor else np.inf

    length, lower = 1.0, energy_at(1.0)
    while length < 16.0 and lower < energy + 0.7 * length * slope:
        longer = energy_at(2.0 * length)
        if not longer < lower:
            return length, lower
        length, lower = 2.0 * length, longer
    while length > 1e-6:
        if lower <= energy + 1e-4 * length * slope + noise:
            return length, lower
        length *= 0.5
        lower = energy_at(length)
    return 0.0, energy


def leave_saddle(assembler: Assembler, state: State, load: float, work: Work) -> State | None:
    """From an unstable equilibrium, whose factor is present, a state of lower energy; None when none is found."""
    direction = _falling_direction(assembler, work)
    if direction is None:
        return None
    energy = assembler.energy(state.u, load)
    length = 0.5 * assembler.cell_size / float(np.abs(direction).max())
    while length * float(np.abs(direction).max()) > 1e-4 * assembler.cell_size:
        for sign in (1.0, -1.0):
            trial = state.u + sign * length * direction
            if assembler.min_jacobian(trial) > 0.1 and assembler.energy(trial, load) < energy:
                return State(trial, assembler.balanced_pressure(trial))
        length *= 0.5
    return None


def _falling_direction(assembler: Assembler, work: Work, vectors: int = 4, sweeps: int = 4) -> FloatArray | None:
    """Displacements (n, 3) of negative curvature by subspace iteration on the inverse, pressure eliminated by the mixed factor."""
    n = assembler.n_free
    basis = np.random.default_rng(0).normal(size=(n, vectors))
    for _ in range(sweeps):
        basis, _ = np.linalg.qr(basis)
        rhs = np.zeros((len(assembler.kept), vectors))
        rhs[:n] = basis
        work.backsolves += vectors
        image = assembler.solver.solve(rhs)[:n]
        ritz = basis.T @ image
        basis_before, basis = basis, image
    inverse_curvature, weights = np.linalg.eigh(0.5 * (ritz + ritz.T))
    if not inverse_curvature[0] < 0.0:
        return None
    step = np.zeros(len(assembler.kept))
    step[:n] = basis_before @ weights[:, 0]
    zero = State(np.zeros((assembler.space.n_nodes, 3)), np.zeros(assembler.space.n_pressures))
    return moved(assembler, zero, 1.0, step).u
