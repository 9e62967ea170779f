"""Objective of every search: squared length of the plain fit's weighted residual (Eq 13 of Yang & Lin, weighed)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.plain_fit import PlainFit


@dataclass(frozen=True, eq=False)
class Misfit:
    """Weighted residual of all deformed states as a function of where the observed points go.

    observations, data : of every state. weighting : of the data vector (n,). correction (n,) mm : what the error of the
    element that moves the points adds to the residual.
    """

    observations: tuple[SurfaceObservation, ...]
    data: tuple[DataVector, ...]
    weighting: Weighting

    @classmethod
    def of(cls, fit: PlainFit) -> Misfit:
        """Misfit of points that the quick element moves."""
        observations = tuple(p.scene.observation for p in fit.linearisation.each)
        return cls(observations, tuple(fit.model.data_vectors), fit.weighting)

    @property
    def first(self) -> Misfit:
        """Misfit of the first state alone."""
        n = self.data[0].n
        return Misfit(self.observations[:1], self.data[:1], Weighting(self.weighting.covariance[:n, :n]))

    def residual(self, moved: Sequence[FloatArray], correction: FloatArray) -> FloatArray:
        """Weighted residual (n,) for displacements (p, 3) mm of every state's `SurfaceObservation.all_points`."""
        each = zip(self.data, self.observations, moved, strict=True)
        unweighted = np.concatenate([data.residual_of(observation, v) for data, observation, v in each])
        return self.weighting.whiten(unweighted + correction)

    def jacobian(
        self, moved: Sequence[FloatArray], sensitivities: Sequence[FloatArray], slope: FloatArray | float = 0.0
    ) -> FloatArray:
        """Derivative (n, t) of the weighted residual, for every state's sensitivities (t, p, 3) mm of the points.

        slope (n, t) : derivative of the correction.
        """
        each = zip(self.data, self.observations, moved, sensitivities, strict=True)
        rows = [data.response_of(observation, v, moves) for data, observation, v, moves in each]
        return self.weighting.whiten(np.vstack(rows) + slope)

    def value(self, moved: Sequence[FloatArray], correction: FloatArray) -> float:
        """Squared length of the weighted residual."""
        return float((self.residual(moved, correction) ** 2).sum())
