"""Identification with a reduced model alone. No equilibrium is solved; a new deformed surface takes a fraction of a
second.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.inference.gauss_newton import GaussNewtonResult, gauss_newton
from palpate.core.inference.posterior import NoiseFacts, Posterior, laplace
from palpate.core.observe.contour_noise import Weighting
from palpate.core.reduced.reduced_model import ReducedModel
from palpate.core.surfaces.distance_field import SignedDistanceField


@dataclass(frozen=True, eq=False)
class ReducedFit:
    """What a reduced model of the organ's surface points and one deformed surface say together.

    model : None where only `linearised` is to be asked, with displacements from elsewhere.
    points : (q, 3) mm at rest, those of the model. target : of the deformed surface. weighting : of the residual (q, q).
    noise : (q, q) mm2, what the residual's covariance is taken to be. error_mm : (q,) what the contours err by, taken off the
    residual: for studies that draw it. expected : of the residual's squared weighted length at the truth, where it is known already.
    """

    model: ReducedModel | None
    points: FloatArray
    target: SignedDistanceField
    weighting: Weighting
    noise: FloatArray
    error_mm: FloatArray = field(default_factory=lambda: np.zeros(0))
    expected: float | None = None

    def value(self, theta: FloatArray) -> float:
        """Squared length of the weighted residual at theta (t,)."""
        distance = self.distance(theta)
        return self.weighting.squared(distance - self.error_mm if len(self.error_mm) else distance)

    def distance(self, theta: FloatArray) -> FloatArray:
        """(q,) mm, unweighted distance of the surface points from the target at theta (t,), without `error_mm`."""
        v = self._known.evaluate(theta)
        return self.target.value_and_gradient(self.points + v)[0]

    def linearise(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residual (q,) and Jacobian (q, t) at theta (t,)."""
        return self.linearised(self._known.evaluate(theta), self._known.gradient(theta))

    def linearised(self, v: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residual and Jacobian from the points' displacements v (q, 3) mm and their derivatives (t, q, 3)."""
        distance, normal = self.target.value_and_gradient(self.points + v)
        if len(self.error_mm):
            distance = distance - self.error_mm
        both = self.weighting.whiten(np.column_stack([distance, np.einsum("tqi,qi->qt", slopes, normal)]))
        return both[:, 0], both[:, 1:]

    def fit(self, starts: FloatArray, bounds: FloatArray) -> GaussNewtonResult:
        """Best optimum over the starts (s, t) within bounds (t, 2). Raises ConvergenceError where no start gives a
        residual.
        """
        ends = [gauss_newton(self.linearise, start, bounds, tolerance=1e-4) for start in starts]
        optima = [end for end in ends if end is not None]
        if not optima:
            raise ConvergenceError("the reduced model gives no residual; build it anew")
        return min(optima, key=lambda end: end.misfit)

    def posterior(self, optimum: GaussNewtonResult, bounds: FloatArray) -> Posterior:
        """Laplace approximation of the posterior at an optimum, see `posterior.laplace`."""
        back = self.weighting.unwhiten_adjoint(optimum.jacobian)
        noise = NoiseFacts(back.T @ self.noise @ back, self._expected)
        return laplace(optimum.theta, optimum.residual, optimum.jacobian, bounds, noise)

    @property
    def _known(self) -> ReducedModel:
        if self.model is None:
            raise InputError("this fit has no reduced model; build one first")
        return self.model

    @cached_property
    def _expected(self) -> float:
        if self.expected is not None:
            return self.expected
        return float(np.trace(self.weighting.apply(self.noise)))
