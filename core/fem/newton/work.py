"""What the iterations of one solve share: options, a count of the work done, and single moves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.linear.choice import FactorisationError
from palpate.core.fem.newton.point_pressures import pressure_step
from palpate.core.fem.state import Residual, State
from palpate.core.fem.tangent import Tangent


@dataclass(frozen=True)
class NewtonOptions:
    """Tolerances and caps.

    rtol : residual relative to the internal forces' magnitude. max_factorisations : work cap per solve, all load steps
    together. max_per_step : iterations of one kind at one load. min_load_step : smallest load increment before giving
    up. jacobian_shrink : smallest det F a step may leave, relative to before. stability : factorise once more at the
    solution so that the inertia is its own (also what sensitivities need). follow_buckling : where the path from rest
    loses its stability, go on to the stable state beyond (`Equilibrium.buckled` says so); without it that is a failure.
    """

    rtol: float = 1e-8
    max_factorisations: int = 200
    max_per_step: int = 14
    min_load_step: float = 1.0 / 128.0
    jacobian_shrink: float = 0.1
    stability: bool = True
    follow_buckling: bool = True


@dataclass
class Work:
    """Work done so far, and why the last attempt ended ("" when it did not fail)."""

    options: NewtonOptions = field(default_factory=NewtonOptions)
    factorisations: int = 0
    backsolves: int = 0
    load_steps: int = 0
    reason: str = ""
    buckled: bool = False
    tangent: Tangent | None = None  # at the last state whose stability was asked for
    slopes: FloatArray | None = None  # of the points' pressures at the state that was factorised

    @property
    def exhausted(self) -> bool:
        """True at the cap; then `reason` says so."""
        if self.factorisations < self.options.max_factorisations:
            return False
        self.reason = f"the cap of {self.options.max_factorisations} factorisations was reached"
        return True

    def factorise(self, assembler: Assembler, values: FloatArray) -> bool:
        """Factorise; False, with `reason`, when the matrix is singular or not finite."""
        self.factorisations += 1
        try:
            assembler.solver.factorise(values)
        except FactorisationError as error:
            self.reason = str(error)
            return False
        return True

    def correction(
        self,
        assembler: Assembler,
        residual: Residual,
        coupling: FloatArray | None = None,
        move: FloatArray | None = None,
    ) -> FloatArray:
        """-K^-1 (residual + coupling) over the kept unknowns, with the present factor; then the points' pressures, if
        there are any.

        move : (3 n,) of constrained unknowns, whose product with the matrix is `coupling`.
        """
        self.backsolves += 1
        b = -np.concatenate([residual.r_u, residual.r_p])[assembler.kept]
        step = assembler.solver.solve_roughly(b if coupling is None else b - coupling)
        if residual.lag is None or self.slopes is None:
            return step
        change = np.zeros(assembler.space.n_displacements) if move is None else move.copy()
        change[assembler.kept] += step
        points = pressure_step(assembler, self.slopes, residual.lag, change.reshape(-1, 3))
        return np.concatenate([step, points.ravel()])


def is_minimum(assembler: Assembler) -> bool:
    """Whether the last factor has the inertia of a minimum of the energy: one negative pivot per pressure unknown, no
    more.
    """
    return assembler.solver.n_negative() == assembler.space.n_pressures


def certify(assembler: Assembler, state: State, load: float, work: Work, last_seen: bool | None) -> bool | None:
    """Stability of an equilibrium by its own inertia, or `last_seen` where the options do without."""
    if not work.options.stability:
        return last_seen
    values, _ = assembler.tangent(state, load)
    if not work.factorise(assembler, values):
        return False
    work.tangent = Tangent.factorised(assembler, state, load)
    return is_minimum(assembler)


def moved(
    assembler: Assembler, state: State, damping: float, step: FloatArray, move: FloatArray | None = None
) -> State:
    """State after `damping` times the kept unknowns' step and the constrained unknowns' move (3 n,)."""
    n, kept = assembler.space.n_displacements, len(assembler.kept)
    change = np.zeros(n + assembler.space.n_pressures)
    change[assembler.kept] = step[:kept]
    if move is not None:
        change[:n] += move
    u = state.u + damping * change[:n].reshape(-1, 3)
    if damping == 1.0 and move is not None and move.any():  # to the last bit, so that the next move is exactly zero
        u = np.where((~assembler.free).reshape(-1, 3), state.u + move.reshape(-1, 3), u)
    q = None if state.q is None else state.q + damping * step[kept:].reshape(state.q.shape)
    return State(u, state.p + damping * change[n:], q)


def size(assembler: Assembler, step: FloatArray, move: FloatArray | None = None) -> float:
    """Root of the sum of squared displacement changes, mm."""
    squared = float(step[: assembler.n_free] @ step[: assembler.n_free])
    return float(np.sqrt(squared + (0.0 if move is None else float(move @ move))))


def relative(assembler: Assembler, residual: Residual) -> float:
    """Free residual over the scale of internal forces; volume residual over the body's volume counts too. NaN counts as
    infinite.
    """
    force = float(np.linalg.norm(residual.r_u[assembler.free]))
    volume = float(np.linalg.norm(residual.r_p)) / assembler.total_volume
    scale = residual.scale
    relative_residual = max(force / scale if scale > 0.0 else force, volume)
    return relative_residual if np.isfinite(relative_residual) else np.inf
