"""The mixed iteration: Newton steps of u and p together with affine-invariant step control (Deuflhard 2011, Newton
Methods for Nonlinear Problems, NLEQ-ERR). A factor is reused as long as the steps contract. Few and cheap steps;
stability is not tested.

Elements without pressure unknowns carry a pressure at each quadrature point, eliminated point by point (Magisano et al.
2017, Int. J. Numer. Meth. Engng 109:1155). Their solution is unchanged; the number of steps is that of a mixed element.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.linear.choice import Iterative
from palpate.core.fem.newton.point_pressures import point_pressures, pressure_slopes
from palpate.core.fem.newton.work import Work, certify, is_minimum, moved, relative, size
from palpate.core.fem.state import Residual, State

_HISTORY = 5  # corrections that the accelerated chord mixes
# Limits on the reuse of a factor: number of steps, and largest mean contraction. A factorisation costs as much as 6
# steps at 2,000 unknowns, 25 at 16,000, 60 at 50,000 (measured); where the solver iterates, a new matrix costs less than one step.
_LARGE = 8000
_CHORD = {"small": (14, 0.5), "large": (30, 0.65), "iterative": (14, 0.05)}
_SMALLEST_DAMPING = 1.0 / 600.0


@dataclass(frozen=True, eq=False)
class Outcome:
    """Where an iteration ended. converged : within tolerance. stable : by inertia, None when unknown.

    in_place : the constrained unknowns stand where they belong, so that the energy iteration could go on from `state`.
    """

    state: State
    converged: bool
    stable: bool | None
    in_place: bool


def iterate_mixed(assembler: Assembler, state: State, goal: FloatArray, load: float, work: Work) -> Outcome:
    """Newton from `state` to the equilibrium at `load`; constrained unknowns go to load * goal (3 n,)."""
    options, held = work.options, ~assembler.free
    state = _with_point_pressures(assembler, state)
    stable: bool | None = None
    arrived = False
    for k in range(options.max_per_step):
        move = np.where(held, load * goal - state.u.reshape(-1), 0.0)
        in_place = not move.any()
        if in_place and (arrived or (k == 0 and _balanced(assembler, state, load, work))):
            state = State(state.u, state.p)
            return Outcome(state, True, certify(assembler, state, load, work, stable), True)
        if work.exhausted:
            return Outcome(state, False, stable, in_place)
        values, coupling = assembler.tangent(state, load, move)
        if not work.factorise(assembler, values):
            return Outcome(state, False, stable, in_place)
        stable = is_minimum(assembler)
        work.slopes = None if state.q is None else pressure_slopes(assembler, state.u)
        residual = assembler.residual(state, load, work.slopes)
        step = work.correction(assembler, residual, coupling, move)
        accepted = _damped(assembler, state, residual, step, move, load, work)
        if accepted is None:
            work.reason = "the step control found no contraction"
            return Outcome(state, False, stable, in_place)
        shrinking = size(assembler, step, move) > 10.0 * float(np.linalg.norm(accepted[0].u - state.u))
        state, arrived = accepted
        if stable is False and shrinking:
            work.reason = "the tangent is indefinite and steps are shrinking"
            return Outcome(state, False, stable, in_place)
    work.reason = f"no convergence in {options.max_per_step} iterations"
    return Outcome(state, False, stable, not np.where(held, load * goal - state.u.reshape(-1), 0.0).any())


def _with_point_pressures(assembler: Assembler, state: State) -> State:
    if assembler.space.n_pressures or state.q is not None:
        return state
    return State(state.u, state.p, point_pressures(assembler, state.u))


def _balanced(assembler: Assembler, state: State, load: float, work: Work) -> bool:
    """Whether a state is within tolerance, with the points' pressures where they belong."""
    return relative(assembler, assembler.residual(State(state.u, state.p), load)) <= work.options.rtol


def _arrived(assembler: Assembler, state: State, residual: Residual, load: float, work: Work) -> bool:
    """The same of a state whose residual is known; where points' pressures still moved, that is not yet the answer."""
    if not relative(assembler, residual) <= work.options.rtol:
        return False
    return residual.lag is None or _balanced(assembler, state, load, work)


def _damped(
    assembler: Assembler,
    state: State,
    residual: Residual,
    step: FloatArray,
    move: FloatArray,
    load: float,
    work: Work,
) -> tuple[State, bool] | None:
    """Largest damping with a contracting simplified correction and no inverted cell; full steps go on with the same
    factor.

    Also whether that is within tolerance.
    """
    length = size(assembler, step, move)
    if not np.isfinite(length):
        return None
    damping, floor = 1.0, work.options.jacobian_shrink * min(residual.min_jacobian, 1.0)
    while damping > _SMALLEST_DAMPING:
        trial = moved(assembler, state, damping, step, move)
        if assembler.min_jacobian(trial.u) > floor:
            if damping < 1.0 and move.any():
                return trial, False  # constrained nodes moved part of the way: judged by the next step
            after = assembler.residual(trial, load, work.slopes)
            if damping == 1.0 and _arrived(assembler, trial, after, load, work):
                return trial, True
            correction = work.correction(assembler, after)
            theta = size(assembler, correction) / length
            if theta < 1.0 - 0.25 * damping or length < 1e-13:
                if damping == 1.0:
                    return _chord(assembler, trial, after, correction, load, work)
                return trial, False
        damping *= 0.5
    return None


def _chord(
    assembler: Assembler, state: State, residual: Residual, correction: FloatArray, load: float, work: Work
) -> tuple[State, bool]:
    """Go on with the present factor, corrections mixed by Anderson's method, while that beats a new factor.

    Anderson (1965, J. ACM 12:547) in the form of Walker & Ni (2011, SIAM J. Numer. Anal. 49:1715, algorithm AA): with
    corrections g_k of states x_k, the next state is x_k + g_k - (dX + dG) c, c the least-squares fit of g_k by dG.
    """
    changes: list[FloatArray] = []  # x_k - x_(k-1) over the kept unknowns
    differences: list[FloatArray] = []  # g_k - g_(k-1)
    length = first = size(assembler, correction)
    distance = relative(assembler, residual)
    most, contraction = _CHORD[_kind(assembler)]
    for k in range(most):
        step = correction
        if differences:
            step = _mixed_step(correction, changes, differences, assembler.n_free)
        trial = moved(assembler, state, 1.0, step)
        if not assembler.min_jacobian(trial.u) > 0.0:
            return state, False
        after = assembler.residual(trial, load, work.slopes)
        residual_after = relative(assembler, after)
        if _arrived(assembler, trial, after, load, work):
            return trial, True
        following = work.correction(assembler, after)
        now = size(assembler, following)
        if not (now < length or (now < 2.0 * length and residual_after < 0.5 * distance)):
            return state, False
        distance = residual_after
        changes = [*changes, step][-_HISTORY:]
        differences = [*differences, following - correction][-_HISTORY:]
        state, correction, length = trial, following, now
        if k >= 2 and now > first * contraction ** (k + 1):
            return state, False  # too slow: a new factor converges quadratically from here
    return state, False


def _kind(assembler: Assembler) -> str:
    if isinstance(assembler.solver, Iterative):
        return "iterative"
    return "large" if len(assembler.kept) > _LARGE else "small"


def _mixed_step(
    correction: FloatArray, changes: list[FloatArray], differences: list[FloatArray], n_free: int
) -> FloatArray:
    """g - (dX + dG) c with c the least-squares fit of g by dG over the displacements, by normal equations: they are
    tiny.
    """
    gram = np.array([[float(a[:n_free] @ b[:n_free]) for b in differences] for a in differences])
    scale = 1.0 / np.sqrt(np.maximum(gram.diagonal(), 1e-300))
    rhs = scale * np.array([float(a[:n_free] @ correction[:n_free]) for a in differences])
    c = scale * np.linalg.lstsq(scale[:, None] * gram * scale, rhs, rcond=1e-12)[0]
    step = correction.copy()
    for weight, change, difference in zip(c, changes, differences, strict=True):
        step -= weight * (change + difference)
    return step
