"""Static equilibrium by a Newton method that survives inverted starts, large loads and nearly incompressible organs.

Two iterations share one matrix. The mixed iteration moves u and p together with affine-invariant step control (Deuflhard 2011,
Newton Methods for Nonlinear Problems, NLEQ-ERR): few, cheap steps, blind to stability. The energy iteration eliminates p, projects
indefinite points (Teran et al. 2005) and searches along the line on E(u): slower, but it ends in a minimum. The load is cut
when neither arrives. Failure is a value with its reason.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from palpate.core.fem.assembly import Assembler, Residual, State
from palpate.core.fem.linear_solvers import FactorisationError
from palpate.core.fem.materials import Material

FloatArray = NDArray[np.float64]


# Load increments above this are halved when the mixed iteration fails; below it the energy iteration takes over.
_PATIENCE = 0.05


@dataclass(frozen=True)
class NewtonOptions:
    """Tolerances and caps.

    rtol : residual relative to the internal forces' magnitude. max_factorisations : work cap per solve, all load steps together.
    min_load_step : smallest load increment before giving up. min_jacobian : smallest det F a step may leave, relative to before.
    stability : factorise once more at the solution so that the inertia is its own (also what sensitivities need).
    """

    rtol: float = 1e-8
    max_factorisations: int = 120
    max_per_step: int = 14
    min_load_step: float = 1.0 / 128.0
    jacobian_shrink: float = 0.1
    stability: bool = True


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The outcome of a solve.

    converged : a stable equilibrium was found. reason : "" or why not. u (n, 3) mm, p (n_p,) kPa: the last good state.
    load : fraction reached. stable : inertia says minimum (None when not checked). residual : relative. min_jacobian : of guarded cells.
    """

    converged: bool
    reason: str
    u: FloatArray
    p: FloatArray
    load: float
    stable: bool | None
    residual: float
    min_jacobian: float
    factorisations: int
    backsolves: int
    load_steps: int


@dataclass
class _Work:
    factorisations: int = 0
    backsolves: int = 0
    load_steps: int = 0
    reason: str = ""
    options: NewtonOptions = field(default_factory=NewtonOptions)

    @property
    def exhausted(self) -> bool:
        return self.factorisations >= self.options.max_factorisations


def solve_equilibrium(
    assembler: Assembler,
    materials: Mapping[int, Material] | None = None,
    prescribed: FloatArray | None = None,
    start: FloatArray | State | None = None,
    options: NewtonOptions | None = None,
) -> Equilibrium:
    """Equilibrium under the full load of the assembler's terms and `prescribed` displacements.

    materials : new ones, or None for those already set. prescribed : (3 n,) mm, read where unknowns are not free; default zero.
    start : displacements (n, 3) or a whole state to start from (a neighbour's solution); an inverted start is repaired or dropped.
    """
    options = options or NewtonOptions()
    if materials is not None:
        assembler.set_materials(materials)
    goal = np.zeros(assembler.space.n_displacements) if prescribed is None else np.asarray(prescribed, float).copy()
    goal[assembler.free] = 0.0
    work = _Work(options=options)
    with np.errstate(all="ignore"):  # a failed trial step may overflow; what it leaves is tested for being finite
        state, load, stable = _march(assembler, goal, start, work)
        residual = assembler.residual(state, load)
    relative = _relative(assembler, residual)
    ok = load == 1.0 and work.reason == "" and stable is not False
    return Equilibrium(
        converged=ok,
        reason=work.reason if work.reason or ok else "the equilibrium found is not stable",
        u=state.u,
        p=state.p,
        load=load,
        stable=stable,
        residual=relative,
        min_jacobian=residual.min_jacobian,
        factorisations=work.factorisations,
        backsolves=work.backsolves,
        load_steps=work.load_steps,
    )


def _march(
    assembler: Assembler, goal: FloatArray, start: FloatArray | State | None, work: _Work
) -> tuple[State, float, bool | None]:
    """Raise the load to 1: at once from a given start, else in as large steps as converge."""
    rest = State(np.zeros((assembler.space.n_nodes, 3)), np.zeros(assembler.space.n_pressures))
    first = _usable_start(assembler, start)
    if first is not None:
        found, stable = _one_load(assembler, first, goal, 0.0, 1.0, work)
        if found is not None:
            return found, 1.0, stable
    state, load, step, stable = rest, 0.0, 1.0, None
    while load < 1.0:
        target = min(1.0, load + step)
        work.reason = ""
        found, seen = _one_load(assembler, state, goal, load, target, work)
        if found is not None:
            state, load, stable, step = found, target, seen, 2.0 * step
            continue
        step = 0.5 * (target - load)
        if step < work.options.min_load_step or work.exhausted:
            why = work.reason or "no equilibrium within reach"
            work.reason = f"stopped at {100 * load:.0f} % of the load: {why}"
            return state, load, stable
    work.reason = ""
    return state, load, stable


def _usable_start(assembler: Assembler, start: FloatArray | State | None) -> State | None:
    if start is None:
        return None
    state = start if isinstance(start, State) else None
    u = state.u if state is not None else np.asarray(start, dtype=float).reshape(-1, 3)
    if not np.isfinite(u).all() or not assembler.min_jacobian(u) > 0.0:
        return None  # inverted: the march from rest, where J = 1, is safer than repairing it
    if state is not None and np.isfinite(state.p).all():
        return State(u.copy(), state.p.copy())
    return State(u.copy(), assembler.balanced_pressure(u))


def _one_load(
    assembler: Assembler, state: State, goal: FloatArray, reached: float, load: float, work: _Work
) -> tuple[State | None, bool | None]:
    """One load level: mixed iteration; the energy iteration if that ended in an unstable state or fails even on small increments."""
    work.load_steps += 1
    found, stable = _mixed(assembler, state, goal, load, work)
    if found is not None and stable is not False:
        return found, stable
    if found is None and load - reached > _PATIENCE:
        return None, stable  # half the increment is cheaper than a fight
    state = found or state
    constrained = goal.reshape(-1, 3) * load
    held = ~assembler.free.reshape(-1, 3)
    if np.abs(np.where(held, state.u - constrained, 0.0)).max(initial=0.0) > 0.0:
        return None, stable  # constrained nodes still have to move, which the energy iteration cannot do
    return _minimise(assembler, state, load, work)


def _mixed(
    assembler: Assembler, state: State, goal: FloatArray, load: float, work: _Work
) -> tuple[State | None, bool | None]:
    """Mixed Newton with natural monotonicity and chord steps while they contract."""
    options, held = work.options, ~assembler.free
    residual = assembler.residual(state, load)
    stable: bool | None = None
    for _ in range(options.max_per_step):
        move = np.where(held, load * goal - state.u.reshape(-1), 0.0)
        if _relative(assembler, residual) <= options.rtol and np.abs(move).max(initial=0.0) == 0.0:
            return state, _stability(assembler, state, load, work, stable)
        if work.exhausted:
            work.reason = f"the cap of {options.max_factorisations} factorisations was reached"
            return None, stable
        values, coupling = assembler.tangent(state, load, move)
        if not _factorise(assembler, values, work):
            return None, stable
        stable = assembler.solver.n_negative() == assembler.space.n_pressures
        step = _backsolve(assembler, residual, coupling, work)
        accepted = _damped(assembler, state, residual, step, move, load, work)
        if accepted is None:
            work.reason = "the step control found no contraction"
            return None, stable
        if stable is False and _size(assembler, step, move) > 10.0 * np.linalg.norm(accepted[0].u - state.u):
            work.reason = "the tangent is indefinite and steps are shrinking"
            return None, stable
        state, residual = accepted
    work.reason = f"no convergence in {options.max_per_step} iterations"
    return None, stable


def _damped(
    assembler: Assembler,
    state: State,
    residual: Residual,
    step: FloatArray,
    move: FloatArray,
    load: float,
    work: _Work,
) -> tuple[State, Residual] | None:
    """Largest damping with a contracting simplified correction and no inverted cell; full steps go on with the same factor."""
    size = _size(assembler, step, move)
    if not np.isfinite(size):
        return None
    damping, floor = 1.0, work.options.jacobian_shrink * min(residual.min_jacobian, 1.0)
    while damping > 1.0 / 600.0:
        trial = _moved(assembler, state, damping, step, move)
        if assembler.min_jacobian(trial.u) > floor:
            after = assembler.residual(trial, load)
            full = damping == 1.0
            left = np.zeros_like(move) if full else (1.0 - damping) * move
            if full and _relative(assembler, after) <= work.options.rtol:
                return trial, after
            if full or not move.any():
                correction = _backsolve(assembler, after, None, work)
                theta = _size(assembler, correction, left) / size
                if theta < 1.0 - 0.25 * damping or size < 1e-13:
                    if full and theta < 0.5:
                        return _chord(assembler, trial, after, correction, theta, load, work)
                    return trial, after
            else:
                return trial, after  # constrained nodes moved part of the way: judged by the next step
        damping *= 0.5
    return None


def _chord(
    assembler: Assembler, state: State, residual: Residual, step: FloatArray, theta: float, load: float, work: _Work
) -> tuple[State, Residual]:
    """Go on with the present factor while each correction is less than a third of the one before."""
    no_move = np.zeros(assembler.space.n_displacements)
    size = _size(assembler, step, no_move)
    for _ in range(8):
        trial = _moved(assembler, state, 1.0, step, no_move)
        if not assembler.min_jacobian(trial.u) > 0.0:
            return state, residual
        after = assembler.residual(trial, load)
        if _relative(assembler, after) <= work.options.rtol:
            return trial, after
        correction = _backsolve(assembler, after, None, work)
        now = _size(assembler, correction, no_move)
        if not now < size:
            return state, residual
        state, residual = trial, after
        if now > 0.3 * size:
            return state, residual
        step, size = correction, now
    return state, residual


def _minimise(assembler: Assembler, state: State, load: float, work: _Work) -> tuple[State | None, bool | None]:
    """Projected Newton on E(u) with Armijo line search; constrained unknowns already stand where they belong."""
    options = work.options
    u = state.u
    energy = assembler.energy(u, load)
    for _ in range(4 * options.max_per_step):
        state = State(u, assembler.balanced_pressure(u))
        residual = assembler.residual(state, load)
        if _relative(assembler, residual) <= options.rtol:
            return state, _stability(assembler, state, load, work, None)
        if work.exhausted:
            work.reason = f"the cap of {options.max_factorisations} factorisations was reached"
            return None, None
        step = _descent_step(assembler, state, residual, load, work)
        if step is None:
            return None, None
        slope = float(step.reshape(-1) @ residual.r_u)
        searched = _line_search(assembler, u, step, energy, slope, load, residual.min_jacobian)
        if searched is None:
            work.reason = "the line search found no lower energy"
            return None, None
        u, energy = searched
    work.reason = "no convergence of the energy iteration"
    return None, None


def _descent_step(
    assembler: Assembler, state: State, residual: Residual, load: float, work: _Work
) -> FloatArray | None:
    """Newton step (n, 3) of the energy; projected where the plain matrix is not that of a minimum."""
    for project in (False, True):
        values, _ = assembler.tangent(state, load, project=project)
        if not _factorise(assembler, values, work):
            return None
        if project or assembler.solver.n_negative() == assembler.space.n_pressures:
            return _moved(
                assembler, State(np.zeros_like(state.u), state.p), 1.0, _backsolve(assembler, residual, None, work)
            ).u
    return None


def _line_search(
    assembler: Assembler, u: FloatArray, step: FloatArray, energy: float, slope: float, load: float, min_jacobian: float
) -> tuple[FloatArray, float] | None:
    if not slope < 0.0:
        return None
    length = 1.0
    noise = 1e-14 * max(abs(energy), 1.0)
    while length > 1e-6:
        trial = u + length * step
        if assembler.min_jacobian(trial) > 0.05 * min(min_jacobian, 1.0):
            lower = assembler.energy(trial, load)
            if lower <= energy + 1e-4 * length * slope + noise:
                return trial, lower
        length *= 0.5
    return None


def _stability(assembler: Assembler, state: State, load: float, work: _Work, last_seen: bool | None) -> bool | None:
    if not work.options.stability:
        return last_seen
    values, _ = assembler.tangent(state, load)
    if not _factorise(assembler, values, work):
        return False
    return assembler.solver.n_negative() == assembler.space.n_pressures


def _factorise(assembler: Assembler, values: FloatArray, work: _Work) -> bool:
    work.factorisations += 1
    try:
        assembler.solver.factorise(values)
    except FactorisationError as error:
        work.reason = str(error)
        return False
    return True


def _backsolve(assembler: Assembler, residual: Residual, coupling: FloatArray | None, work: _Work) -> FloatArray:
    work.backsolves += 1
    b = -np.concatenate([residual.r_u, residual.r_p])[assembler.kept]
    return assembler.solver.solve(b if coupling is None else b - coupling)


def _moved(
    assembler: Assembler, state: State, damping: float, step: FloatArray, move: FloatArray | None = None
) -> State:
    n = assembler.space.n_displacements
    change = np.zeros(n + assembler.space.n_pressures)
    change[assembler.kept] = step
    if move is not None:
        change[:n] += move
    exact = damping == 1.0 and move is not None
    u = state.u + damping * change[:n].reshape(-1, 3)
    if exact and move is not None and move.any():
        held = (~assembler.free).reshape(-1, 3)
        u = np.where(held, state.u + move.reshape(-1, 3), u)
    return State(u, state.p + damping * change[n:])


def _size(assembler: Assembler, step: FloatArray, move: FloatArray) -> float:
    """Root of the sum of squared displacement changes, mm."""
    n_free = int(assembler.free.sum())
    return float(np.sqrt((step[:n_free] ** 2).sum() + (move**2).sum()))


def _relative(assembler: Assembler, residual: Residual) -> float:
    """Free residual over the scale of internal forces; volume residual over the body's volume counts too. NaN counts as infinite."""
    force = float(np.linalg.norm(residual.r_u[assembler.free]))
    volume = float(np.linalg.norm(residual.r_p)) / float(assembler.space.mesh.volumes.sum())
    scale = residual.scale
    relative = max(force / scale if scale > 0.0 else force, volume)
    return relative if np.isfinite(relative) else np.inf


def quicker(options: NewtonOptions) -> NewtonOptions:
    """The same without the extra factorisation that certifies stability: for a swarm's many particles."""
    return replace(options, stability=False)
