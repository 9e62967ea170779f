"""How badly a displacement explains what was seen: surface residual and landmarks, weighed by their noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.identify.scene import Scene
from palpate.core.observe.noise import NUGGET_MM, Weighting, noise_modes, smooth_covariance

FloatArray = NDArray[np.float64]

# Standard deviation of a landmark's match between two scans, mm per axis.
LANDMARK_SD_MM = 0.5


@dataclass(frozen=True, eq=False)
class Misfit:
    """Residuals of all data and their weights; `value` is the squared Mahalanobis length of the residual.

    surface : weighting of the surface residual (q, q), both contours' noise and the walls' noise carried through the model.
    """

    scene: Scene
    surface: Weighting

    @classmethod
    def of(cls, scene: Scene, wall_response: FloatArray | None = None) -> Misfit:
        """wall_response : (q, m) mm, change of the surface residual per unit of each wall noise mode; none counted if None."""
        facts, observation = scene.problem.facts, scene.observation
        sd, length = np.sqrt(2.0) * facts.noise_sd_mm, facts.noise_correlation_mm
        covariance = smooth_covariance(observation.points, sd, length)
        covariance[np.diag_indices_from(covariance)] += NUGGET_MM**2
        if wall_response is not None:
            covariance = covariance + wall_response @ wall_response.T
        return cls(scene, Weighting(covariance))

    def residual(self, u: FloatArray) -> FloatArray:
        """Whitened residual (q + 3 k,) of nodal displacements u (n, 3): its square is chi-squared distributed at the truth."""
        return self.residual_of(self.scene.observation.all_points @ u)

    def residual_of(self, v: FloatArray) -> FloatArray:
        """The same from the displacements v (q + k, 3) of surface points and landmarks."""
        observation = self.scene.observation
        q = len(observation.points)
        surface = self.surface.whiten(observation.residual_of(v[:q]))
        marks = observation.landmarks[:, :3] + v[q:] - observation.landmarks[:, 3:]
        return np.concatenate([surface, marks.ravel() / LANDMARK_SD_MM])

    def jacobian(self, u: FloatArray, sensitivities: FloatArray) -> FloatArray:
        """Whitened derivative (q + 3 k, t) for du/dtheta (t, n, 3)."""
        observation = self.scene.observation
        surface = self.surface.whiten(observation.jacobian(u, sensitivities))
        marks = [(observation.landmark_operator @ s).ravel() / LANDMARK_SD_MM for s in sensitivities]
        return np.vstack([surface, np.stack(marks, axis=1)])

    def value(self, u: FloatArray) -> float:
        """Squared length of the whitened residual."""
        return float((self.residual(u) ** 2).sum())


def wall_response(scene: Scene, u: FloatArray) -> FloatArray:
    """(q, m) mm: how contour noise on the walls moves the predicted organ surface along its normal.

    One back-substitution for each smooth mode of wall noise; the tangent at u must be factorised.
    """
    facts = scene.problem.facts
    columns = []
    n = scene.space.n_displacements
    for wall in scene.walls:
        modes = noise_modes(wall.rest, np.sqrt(2.0) * facts.noise_sd_mm, facts.noise_correlation_mm)
        weight = (wall.stiffness * wall.points.measure)[:, None] * wall.normal
        rhs = np.zeros((n + scene.space.n_pressures, modes.shape[1]))
        for j in range(modes.shape[1]):
            np.add.at(rhs[:, j], wall.unknowns, wall.points.spread(weight * modes[:, j : j + 1]))
        moved = np.zeros_like(rhs)
        moved[scene.assembler.kept] = scene.assembler.solver.solve(rhs[scene.assembler.kept])
        fields = moved[:n].T.reshape(-1, scene.space.n_nodes, 3)
        columns.append(scene.observation.jacobian(u, fields))
    return np.hstack(columns) if columns else np.zeros((len(scene.observation.points), 0))
