"""Objective of every search: squared length of the plain fit's weighted residual (Eq 13 of Yang & Lin, weighed)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.observe.contour_noise import Weighting
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.plain_fit import PlainFit


@dataclass(frozen=True, eq=False)
class Misfit:
    """Weighted residual of all deformed states as a function of where the observed points go.

    observations, data : of every state. correction (n,) mm : added to the residual, for the error of the element that
    moves the points. weighting : of the data vector (n,).
    """

    observations: tuple[SurfaceObservation, ...]
    data: tuple[DataVector, ...]
    correction: FloatArray
    weighting: Weighting

    @classmethod
    def of(cls, fit: PlainFit) -> Misfit:
        """Misfit of points that the quick element moves."""
        observations = tuple(p.scene.observation for p in fit.linearisation.each)
        return cls(observations, tuple(fit.model.data_vectors), fit.model.correction, fit.weighting)

    def first(self, correction: FloatArray) -> Misfit:
        """Misfit of the first state alone, with another correction (n_1,) mm."""
        n = self.data[0].n
        weighting = Weighting(self.weighting.covariance[:n, :n])
        return replace(
            self, observations=self.observations[:1], data=self.data[:1], correction=correction, weighting=weighting
        )

    def residual(self, moved: Sequence[FloatArray]) -> FloatArray:
        """Weighted residual (n,) for displacements (p, 3) mm of every state's `SurfaceObservation.all_points`."""
        each = zip(self.data, self.observations, moved, strict=True)
        unweighted = np.concatenate([data.residual_of(observation, v) for data, observation, v in each])
        return self.weighting.whiten(unweighted + self.correction)

    def jacobian(self, moved: Sequence[FloatArray], sensitivities: Sequence[FloatArray]) -> FloatArray:
        """Derivative (n, t) of the weighted residual, for every state's sensitivities (t, p, 3) mm of the points."""
        each = zip(self.data, self.observations, moved, sensitivities, strict=True)
        rows = [data.response_of(observation, v, moves) for data, observation, v, moves in each]
        return self.weighting.whiten(np.vstack(rows))

    def value(self, moved: Sequence[FloatArray]) -> float:
        """Squared length of the weighted residual."""
        return float((self.residual(moved) ** 2).sum())
