"""Identification from a reduced model alone: no equilibrium is solved, so a new deformed surface costs a fraction of a second."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import ConvergenceError
from palpate.core.fem.reduced import ReducedModel
from palpate.core.identify.gauss_newton import GaussNewtonResult, gauss_newton
from palpate.core.identify.posterior import NoiseFacts, Posterior, laplace
from palpate.core.observe.distance_field import SignedDistanceField
from palpate.core.observe.noise import Weighting

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ReducedFit:
    """What a reduced model of the organ's surface points and one deformed surface say together.

    points : (q, 3) mm at rest, those of the model. target : of the deformed surface. weighting : of the residual (q, q).
    noise : (q, q) mm2, what the residual's covariance is taken to be. error_mm : (q,) what the contours err by, taken off the
    residual: for studies that draw it.
    """

    model: ReducedModel
    points: FloatArray
    target: SignedDistanceField
    weighting: Weighting
    noise: FloatArray
    error_mm: FloatArray = field(default_factory=lambda: np.zeros(0))

    def linearise(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residual (q,) and Jacobian (q, t) at theta (t,)."""
        distance, normal = self.target.value_and_gradient(self.points + self.model.evaluate(theta))
        if len(self.error_mm):
            distance = distance - self.error_mm
        slopes = np.einsum("tqi,qi->qt", self.model.gradient(theta), normal)
        both = self.weighting.whiten(np.column_stack([distance, slopes]))
        return both[:, 0], both[:, 1:]

    def fit(self, starts: FloatArray) -> GaussNewtonResult:
        """The best optimum from starts (s, t). Raises ConvergenceError where none ends."""
        ends = [gauss_newton(self.linearise, start, self.model.bounds, tolerance=1e-4) for start in starts]
        found = [end for end in ends if end is not None]
        if not found:
            raise ConvergenceError("the reduced model gives no residual; build it anew")
        return min(found, key=lambda end: end.misfit)

    def posterior(self, found: GaussNewtonResult) -> Posterior:
        """Laplace's approximation at an optimum, see `posterior.laplace`."""
        back = self.weighting.unwhiten_adjoint(found.jacobian)
        noise = NoiseFacts(back.T @ self.noise @ back, self._expected)
        return laplace(found.theta, found.residual, found.jacobian, self.model.bounds, noise)

    @cached_property
    def _expected(self) -> float:
        return float(np.trace(self.weighting.apply(self.noise)))
