"""Weighted residual of a displacement: surface distance (Eq 13 of Yang & Lin) and landmarks, each divided by its noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.forward.make_scene import Scene
from palpate.core.observe.contour_noise import Weighting, contour_covariance, noise_modes, weighting_covariance

# Standard deviation of one landmark's match between two scans, mm per axis.
LANDMARK_SD_MM = 0.5


@dataclass(frozen=True, eq=False)
class Misfit:
    """Residuals of all data with their weights; `value` is the squared length of the weighted residual.

    surface : weighting of the surface residual (q, q). noise : (q, q) mm2, assumed covariance of the surface residual.
    Both contain the noise of the walls' contours, carried through the model. core.observe.contour_noise explains how
    weighting and noise differ.
    """

    scene: Scene
    surface: Weighting
    noise: FloatArray

    @classmethod
    def of(cls, scene: Scene, *responses: FloatArray) -> Misfit:
        """Misfit of a scene.

        responses : (q, m) mm each, change of the surface residual per unit of a further error: contour noise of the
        walls, heterogeneity of the regions.
        """
        facts, points = scene.problem.facts, scene.observation.points
        sd, length = facts.noise_sd_mm, facts.noise_correlation_mm
        further = sum((response @ response.T for response in responses), np.zeros((len(points), len(points))))
        weighting = Weighting(weighting_covariance(points, sd, length) + further)
        return cls(scene, weighting, contour_covariance(points, sd, length) + further)

    @cached_property
    def expected(self) -> float:
        """Expected `value` at the true parameters."""
        return float(np.trace(self.surface.apply(self.noise))) + self.scene.observation.landmarks.shape[0] * 3.0

    @property
    def rows(self) -> int:
        """Length q + 3 k of the weighted residual."""
        return len(self.noise) + 3 * len(self.scene.observation.landmarks)

    def score_covariance(self, jacobian: FloatArray) -> FloatArray:
        """(t, t) covariance of J' r under the noise, for the whitened Jacobian J (q + 3 k, t)."""
        q = len(self.noise)
        weighed = self.surface.unwhiten_adjoint(jacobian[:q])
        return weighed.T @ self.noise @ weighed + jacobian[q:].T @ jacobian[q:]

    def residual(self, u: FloatArray) -> FloatArray:
        """Weighted residual (q + 3 k,) of nodal displacements u (n, 3) mm."""
        return self.residual_of(self.scene.observation.all_points @ u)

    def residual_of(self, v: FloatArray) -> FloatArray:
        """Weighted residual (q + 3 k,) of the displacements v (q + k, 3) mm of surface points and landmarks."""
        observation = self.scene.observation
        q = len(observation.points)
        surface = self.surface.whiten(observation.residual_of(v[:q]))
        marks = observation.landmarks[:, :3] + v[q:] - observation.landmarks[:, 3:]
        return np.concatenate([surface, marks.ravel() / LANDMARK_SD_MM])

    def jacobian(self, u: FloatArray, sensitivities: FloatArray) -> FloatArray:
        """Whitened Jacobian (q + 3 k, t) at u (n, 3) mm for the sensitivities du/dtheta (t, n, 3)."""
        observation = self.scene.observation
        surface = self.surface.whiten(observation.jacobian(u, sensitivities))
        marks = [(observation.landmark_operator @ s).ravel() / LANDMARK_SD_MM for s in sensitivities]
        return np.vstack([surface, np.stack(marks, axis=1)])

    def value(self, u: FloatArray) -> float:
        """Squared length of the weighted residual of nodal displacements u (n, 3) mm."""
        return float((self.residual(u) ** 2).sum())


def wall_response(scene: Scene, equilibrium: Equilibrium) -> FloatArray:
    """Sensitivity (q, m) mm of the predicted organ surface, along its normal, to contour noise on the walls.

    One back-substitution for each smooth mode of wall noise. Precondition: the equilibrium was solved with its
    stability check, so that its tangent is factorised.
    """
    facts = scene.problem.facts
    columns = []
    for wall in scene.walls:
        modes = noise_modes(wall.rest, np.sqrt(2.0) * facts.noise_sd_mm, facts.noise_correlation_mm)
        weight = (wall.stiffness * wall.points.measure)[:, None] * wall.normal
        rhs = np.zeros((scene.space.n_displacements + scene.space.n_pressures, modes.shape[1]))
        for j in range(modes.shape[1]):
            np.add.at(rhs[:, j], wall.unknowns, wall.points.spread(weight * modes[:, j : j + 1]))
        fields = equilibrium.tangent.displacements(rhs[scene.assembler.kept])
        columns.append(scene.observation.jacobian(equilibrium.u, fields))
    return np.hstack(columns) if columns else np.zeros((len(scene.observation.points), 0))
