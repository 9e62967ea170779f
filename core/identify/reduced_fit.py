"""Identification with a reduced model alone. No equilibrium is solved; a new deformed surface takes a fraction of a
second.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.identify.misfit import LANDMARK_SD_MM
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
    landmarks : (k, 6) mm, rest and deformed; the model's points are then the surface's and these.
    """

    model: ReducedModel | None
    points: FloatArray
    target: SignedDistanceField
    weighting: Weighting
    noise: FloatArray
    error_mm: FloatArray = field(default_factory=lambda: np.zeros(0))
    expected: float | None = None
    landmarks: FloatArray = field(default_factory=lambda: np.zeros((0, 6)))

    def value(self, theta: FloatArray) -> float:
        """Squared length of the weighted residual at theta (t,)."""
        v, q = self._known.evaluate(theta), len(self.points)
        distance = self.target.value_and_gradient(self.points + v[:q])[0]
        surface = self.weighting.squared(distance - self.error_mm if len(self.error_mm) else distance)
        return surface + float((self._marks(v[q:]) ** 2).sum())

    def distance(self, theta: FloatArray) -> FloatArray:
        """(q,) mm, unweighted distance of the surface points from the target at theta (t,), without `error_mm`."""
        v = self._known.evaluate(theta)[: len(self.points)]
        return self.target.value_and_gradient(self.points + v)[0]

    def linearise(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residual (q + 3 k,) and Jacobian (q + 3 k, t) at theta (t,)."""
        return self.linearised(self._known.evaluate(theta), self._known.gradient(theta))

    def linearised(self, v: FloatArray, slopes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weighted residual and Jacobian from the points' displacements v (q + k, 3) mm and their derivatives (t, q +
        k, 3).
        """
        q = len(self.points)
        distance, normal = self.target.value_and_gradient(self.points + v[:q])
        if len(self.error_mm):
            distance = distance - self.error_mm
        along = np.einsum("tqi,qi->qt", slopes[:, :q], normal)
        both = self.weighting.whiten(np.column_stack([distance, along]))
        marks = np.column_stack([self._marks(v[q:]), slopes[:, q:].reshape(len(slopes), -1).T / LANDMARK_SD_MM])
        both = np.vstack([both, marks])
        return both[:, 0], both[:, 1:]

    def _marks(self, v: FloatArray) -> FloatArray:
        """Weighted residual (3 k,) of landmarks that move by v (k, 3)."""
        return np.asarray((self.landmarks[:, :3] + v - self.landmarks[:, 3:]).ravel() / LANDMARK_SD_MM)

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
        q = len(self.points)
        back, marks = self.weighting.unwhiten_adjoint(optimum.jacobian[:q]), optimum.jacobian[q:]
        noise = NoiseFacts(back.T @ self.noise @ back + marks.T @ marks, self._expected)
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
        return float(np.trace(self.weighting.apply(self.noise))) + 3.0 * len(self.landmarks)
