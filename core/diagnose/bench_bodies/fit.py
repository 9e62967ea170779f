"""Fit of a body's stiffness, and of effects, to the markers of all states at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies.scene import BodySolver
from palpate.core.diagnose.effects import Effect, Variant
from palpate.core.fem.assembly import State
from palpate.core.forward.composition import Composition
from palpate.core.inference.gauss_newton import gauss_newton
from palpate.core.observe.contour_noise import Weighting
from palpate.core.residual.linearised_model import out_of_balance

# Numerical: step of the finite differences, of ln G and of phi in prior standard deviations.
_STEP = 1e-3
# Numerical: a fit ends when no parameter moves by more than this, or after so many solves.
_TOLERANCE, _EVALUATIONS = 5e-3, 20
# Precision of ln G's prior: none to speak of.
_FLAT = 1e-3


@dataclass(frozen=True, eq=False)
class Added:
    """Effect added to the plain body, with one variant for each state, since loads differ between states."""

    effect: Effect
    variants: Sequence[Variant]


@dataclass(frozen=True, eq=False)
class BodyModel:
    """Model of a body with any effects added.

    Parameters x (1 + k,) : ln G (G in kPa), then each effect's phi in prior standard deviations.
    """

    solver: BodySolver
    added: tuple[Added, ...] = ()

    @property
    def scales(self) -> FloatArray:
        """Prior standard deviations (k,) of all effects' parameters, in their own units."""
        return np.concatenate([np.zeros(0), *(a.effect.scales for a in self.added)])

    @property
    def bounds(self) -> FloatArray:
        """Lower and upper bounds (1 + k, 2) of x."""
        effects = [a.effect.bounds / a.effect.scales[:, None] for a in self.added]
        return np.vstack([np.log([self.solver.problem.bounds_kpa]), *effects])

    def composition(self, x: FloatArray, state: int) -> Composition:
        """Composition at parameters x (1 + k,) in the state of this index."""
        out, start = Composition(self.solver.problem.shell), 1
        for a in self.added:
            n = len(a.effect.parameters)
            out = a.variants[state].applied(out, x[start : start + n] * a.effect.scales)
            start += n
        return out

    def linearised(self, x: FloatArray, which: Sequence[int]) -> tuple[FloatArray, FloatArray] | None:
        """Residual (m,) mm, predicted minus observed, of the markers of the states `which`; its derivative (m, 1 + k).

        None when a state has no equilibrium at x (1 + k,).
        """
        r, J = [], []
        for k in which:
            state = self.solver.problem.states[k]
            equilibrium = self.solver.solve(self.composition(x, k), x[:1], state)
            if not equilibrium.converged:
                return None
            balance = out_of_balance(self.solver.assembler, State(equilibrium.u, equilibrium.p))
            here = self.solver.markers(equilibrium.u, state)
            r.append((here - state.moved).ravel())
            columns = []
            for step in _STEP * np.eye(len(x)):
                y = x + step
                u = equilibrium.u + self.solver.first_order(self.composition(y, k), y[:1], state, equilibrium, balance)
                columns.append((self.solver.markers(u, state) - here).ravel() / _STEP)
            J.append(np.stack(columns, axis=1))
        return np.concatenate(r), np.vstack(J)


@dataclass(frozen=True, eq=False)
class BodyFit:
    """Model of a body at its best fit to the markers.

    x (1 + k,) : see `BodyModel`. residual (m,) mm, jacobian (m, 1 + k) mm. cost : weighted squares and prior.
    covariance (1 + k, 1 + k) : of x. volume : half the logarithm of its determinant.
    """

    model: BodyModel
    which: tuple[int, ...]
    x: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    cost: float
    covariance: FloatArray
    volume: float

    def log_evidence(self, plain: BodyFit) -> float:
        """Log evidence (Laplace's approximation) against the plain model fitted to the same states."""
        return 0.5 * (plain.cost - self.cost) + self.volume - plain.volume


def weighting(solver: BodySolver, which: Sequence[int]) -> Weighting:
    """Weighting of the markers of the states `which` together."""
    common = solver.options.noise_model.markers_common
    return Weighting(block_diag(*(solver.problem.states[k].covariance(common) for k in which)))


def fit_body(model: BodyModel, which: Sequence[int], start: FloatArray) -> BodyFit | None:
    """Gauss-Newton fit to the states `which` from x = start (1 + k,); None when no equilibrium was found."""
    weight = weighting(model.solver, which)
    prior = np.diag(np.concatenate([[0.0], np.ones(len(start) - 1)]))

    def linearise(x: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        linearised = model.linearised(x, which)
        if linearised is None:
            return None
        r, J = linearised
        return np.concatenate([weight.whiten(r), prior @ x]), np.vstack([weight.whiten(J), prior])

    best = gauss_newton(linearise, start, model.bounds, _TOLERANCE, _EVALUATIONS)
    if best is None:
        return None
    n = len(best.residual) - len(start)
    H = best.jacobian.T @ best.jacobian + _FLAT * np.diag(np.arange(len(start)) == 0)
    L = weight.covariance
    white = np.linalg.cholesky(L)
    residual, jacobian = white @ best.residual[:n], white @ best.jacobian[:n]
    volume = -0.5 * float(np.linalg.slogdet(H)[1])
    covariance = np.asarray(np.linalg.inv(H), dtype=np.float64)
    return BodyFit(model, tuple(which), best.theta, residual, jacobian, best.misfit, covariance, volume)
