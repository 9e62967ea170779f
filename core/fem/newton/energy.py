"""The energy iteration: p eliminated, indefinite points projected (Teran et al. 2005), line search on E(u). Slower than
the mixed iteration, but it ends in a minimum; from an unstable equilibrium it leaves along the direction in which the
energy falls.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.newton.mixed import Outcome, iterate_mixed
from palpate.core.fem.newton.work import Work, is_minimum, moved, relative
from palpate.core.fem.state import Residual, State

_NEAR = 1e-3  # relative residual below which the mixed iteration is tried again
_SMALLEST_SHARE = 0.05  # of the projection, once the plain matrix has failed


def minimise(
    assembler: Assembler, state: State, goal: FloatArray, load: float, work: Work, iterations: int = 60
) -> Outcome:
    """Descend on E(u) from `state`; constrained unknowns already stand at load * goal and stay there.

    The Hessian takes its pressure from the linear prediction of the last step, not from the present volume error, which
    a large bulk modulus would blow up; with any pressure the step is a descent direction, since its right-hand side is
    E's gradient.
    """
    u, energy = state.u, assembler.energy(state.u, load)
    pressure, near, share = state.p, _NEAR, 0.0
    for _ in range(iterations):
        balanced = State(u, assembler.balanced_pressure(u))
        residual = assembler.residual(balanced, load)
        distance = relative(assembler, residual)
        if distance <= max(near, work.options.rtol):
            near = 0.1 * distance
            ended = iterate_mixed(assembler, balanced, goal, load, work)
            if ended.converged and ended.stable is not False:
                return ended
        step, share = _descent_step(assembler, State(u, pressure), residual, load, work, share)
        if step is None:
            return Outcome(balanced, False, None, True)
        direction = moved(assembler, State(np.zeros_like(u), np.zeros_like(pressure)), 1.0, step)
        slope = float(direction.u.reshape(-1) @ residual.r_u)
        lower = _line_search(assembler, balanced, direction, energy, slope, load, residual.min_jacobian, work)
        if lower is None:
            work.reason = "the line search found no lower energy"
            return Outcome(balanced, False, None, True)
        u, pressure, energy = lower
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
    state: State,
    direction: State,
    energy: float,
    slope: float,
    load: float,
    min_jacobian: float,
    work: Work,
) -> tuple[FloatArray, FloatArray, float] | None:
    """Armijo, with longer steps while the energy falls as the slope says: (u, predicted p, energy), or None when there
    is none.

    Where a step follows the bulk's stiff valley its second-order change of volume is taken back with the present
    factor, as in second-order corrections of constrained optimisation (Nocedal & Wright 2006, section 15.6).
    """
    if not slope < 0.0:
        return None
    floor, noise = 0.05 * min(min_jacobian, 1.0), 1e-14 * max(abs(energy), 1.0)

    def at(length: float) -> tuple[FloatArray, FloatArray, float]:
        trial = State(state.u + length * direction.u, state.p + length * direction.p)
        if not assembler.min_jacobian(trial.u) > floor:
            return trial.u, trial.p, np.inf
        plain = trial.u, trial.p, assembler.energy(trial.u, load)
        if len(trial.p) == 0 or plain[2] <= energy + 0.3 * length * slope:
            return plain
        after = assembler.residual(trial, load)
        back = work.correction(assembler, replace(after, r_u=np.zeros_like(after.r_u)))
        mended = moved(assembler, trial, 1.0, back)
        if not assembler.min_jacobian(mended.u) > floor:
            return plain
        lower = assembler.energy(mended.u, load)
        return (mended.u, mended.p, lower) if lower < plain[2] else plain

    length, best = 1.0, at(1.0)
    while length < 16.0 and best[2] < energy + 0.7 * length * slope:
        longer = at(2.0 * length)
        if not longer[2] < best[2]:
            return best
        length, best = 2.0 * length, longer
    while length > 1e-6:
        if best[2] <= energy + 1e-4 * length * slope + noise:
            return best
        length *= 0.5
        best = at(length)
    return None


def leave_saddle(assembler: Assembler, state: State, load: float, work: Work) -> State | None:
    """A state of lower energy than an unstable equilibrium; None when none is found.

    Precondition: the present factor is that equilibrium's.
    """
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
    """Displacements (n, 3) of negative curvature by subspace iteration on the inverse, pressure eliminated by the mixed
    factor.
    """
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
