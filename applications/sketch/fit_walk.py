"""The residual of keyframes along Gauss-Newton's path, and its Jacobian in stiffness ratios and rim forces."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.applications.sketch.figure import Figure
from palpate.applications.sketch.residual import Target, residual_of
from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.state import State

# Bounds of ln ratio; prior standard deviation and bound of force coefficients, which regularise what the outlines do
# not determine.
RATIO_BOUNDS = (np.log(1.0 / 50.0), np.log(50.0))
_FORCE_SD, _FORCE_BOUND = 60.0, 300.0
# Prior standard deviation of ln ratio: about a factor of ten.
RATIO_SD = 2.3
# Mean distance of the rim's points from their partners, in figure sizes, above which the rim is on the wrong part of a
# line.
_ASTRAY = 0.3


@dataclass(frozen=True)
class FitOptions:
    """line_error : standard deviation of the drawn lines, in figure sizes. evaluations : most, of one Gauss-Newton
    run.
    """

    line_error: float = 0.004
    evaluations: int = 30


@dataclass
class Walk:
    """Linearises the residual along Gauss-Newton's path; every equilibrium starts from the one before.

    basis : of the forces. share : of the way to the targets' partners that is gone, None to meet their lines. fixed :
    theta, where only forces are looked for. last : where the next equilibria start. best, lowest : the equilibria of
    the least residual, and its square.
    """

    figure: Figure
    targets: tuple[Target, ...]
    basis: FloatArray
    options: FitOptions
    share: float | None
    fixed: FloatArray | None = None
    last: list[State | None] = field(default_factory=list)
    best: tuple[Equilibrium, ...] = ()
    lowest: float = np.inf
    solves: int = 0

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """theta (P - 1,) and coefficients (k, r)."""
        n = 0 if self.fixed is not None else len(self.figure.parts) - 1
        return (x[:n] if self.fixed is None else self.fixed), x[n:].reshape(len(self.targets), -1)

    def __call__(self, x: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Residual and Jacobian at x; None where a keyframe has no equilibrium near its line."""
        theta, forces = self.split(x)
        rows, jacobians, equilibria = [], [], []
        for k, target in enumerate(self.targets):
            end = self.figure.solve(theta, np.tensordot(forces[k], self.basis, 1), self.last[k])
            self.solves += 1
            if not end.converged or self._elsewhere(end, target):
                return None
            equilibria.append(end)
            moves = self.figure.sensitivities(theta, end, self.basis)
            residual, jacobian = residual_of(self.figure, end, moves, target, self.share, self.options.line_error)
            rows.append(residual)
            jacobians.append(jacobian)
        self.last = [State(e.u, e.p) for e in equilibria]
        residual, jacobian = self._stacked(rows, jacobians, x)
        if residual @ residual < self.lowest:
            self.lowest, self.best = float(residual @ residual), tuple(equilibria)
        return residual, jacobian

    def _elsewhere(self, end: Equilibrium, target: Target) -> bool:
        """Whether the figure has turned over or snapped through, so that the rim lies on the wrong part of the line."""
        off = np.linalg.norm(self.figure.rim_at(end.u).points - target.partners, axis=1)
        return self.share is None and float(off.mean()) > _ASTRAY * self.figure.outline.size

    def _stacked(self, rows: list[FloatArray], parts: list[FloatArray], x: FloatArray) -> tuple[FloatArray, FloatArray]:
        n, r = len(self.figure.parts) - 1, len(self.basis)
        shown = 0 if self.fixed is not None else n
        jacobian = np.zeros((sum(map(len, rows)), shown + r * len(rows)))
        start = 0
        for k, part in enumerate(parts):
            stop = start + len(part)
            jacobian[start:stop, :shown] = part[:, :shown]
            jacobian[start:stop, shown + k * r : shown + (k + 1) * r] = part[:, n:]
            start = stop
        prior = np.diag(np.where(np.arange(len(x)) < shown, 1.0 / RATIO_SD, 1.0 / _FORCE_SD))
        return np.concatenate([*rows, prior @ x]), np.vstack([jacobian, prior])

    def bounds(self) -> FloatArray:
        """(n, 2) of x."""
        n = (0 if self.fixed is not None else len(self.figure.parts) - 1) + len(self.targets) * len(self.basis)
        bounds = np.tile([-_FORCE_BOUND, _FORCE_BOUND], (n, 1))
        if self.fixed is None:
            bounds[: len(self.figure.parts) - 1] = RATIO_BOUNDS
        return bounds
