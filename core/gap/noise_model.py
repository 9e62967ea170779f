"""Covariance of everything that is not an effect: contours of organ and walls, where walls slid, the mesh, landmarks.

Calibrated on cases without a hidden effect only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.fem.sensitivity import response_to_forces
from palpate.core.gap.scene import GapScene
from palpate.core.gap.sight import Sight
from palpate.core.observe.noise import noise_modes, smooth_covariance

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseSizes:
    """Standard deviations, mm. along : of a wall's motion along itself, which no scan shows. along_correlation_mm : its length.

    own : of every surface point (extraction, voxels). landmark : per axis. contour : factor on the contour noise the case states.
    mesh : share of the difference between two elements that may be left in the better one.
    """

    along: float = 1.0
    along_correlation_mm: float = 15.0
    own: float = 0.2
    landmark: float = 0.45
    contour: float = 1.0
    mesh: float = 0.3


@dataclass(frozen=True, eq=False)
class NoiseParts:
    """Parts of the covariance (n, n) mm2: `contour` scales with the contours' variance, `along` with the walls'."""

    contour: FloatArray
    along: FloatArray
    own: FloatArray
    marks: FloatArray
    floor: FloatArray

    @classmethod
    def of(cls, scene: GapScene, sight: Sight, u: FloatArray) -> NoiseParts:
        """At the equilibrium u, whose tangent must be factorised."""
        facts = scene.problem.facts
        sd, length = np.sqrt(2.0) * facts.noise_sd_mm, facts.noise_correlation_mm
        n, k = sight.n, sight.n_modes
        contour, own, marks, floor = (np.zeros((n, n)) for _ in range(4))
        C = smooth_covariance(scene.observation.points, sd, length)
        contour[:k, :k] = sight.modes.T @ C @ sight.modes
        across, along = _wall_forces(scene, sd, length), _sliding_forces(scene)
        R = sight.response(scene, u, response_to_forces(scene.assembler, across))
        contour += R @ R.T
        own[np.arange(k), np.arange(k)] = 1.0
        at = np.arange(sight.marks.start, sight.marks.stop)
        marks[at, at] = 1.0
        if sight.bone is not None:
            contour[-6:, -6:] = sight.bone.covariance(facts.noise_sd_mm, length) - sight.bone.covariance(0.0, length)
            floor[-6:, -6:] = sight.bone.covariance(0.0, length)
        return cls(contour, _along(scene, sight, u, along), own, marks, floor)

    def covariance(self, sizes: NoiseSizes, mesh: FloatArray) -> FloatArray:
        """(n, n); mesh : (n,) difference of the residual between two elements."""
        out = sizes.contour**2 * self.contour + sizes.along**2 * self.along + sizes.own**2 * self.own
        return out + sizes.landmark**2 * self.marks + self.floor + sizes.mesh**2 * np.outer(mesh, mesh)


def _wall_forces(scene: GapScene, sd: float, length: float) -> FloatArray:
    """(r, nodes, 3) mN: what pushes the walls by each smooth mode of their contours' noise."""
    out = []
    for wall in scene.walls:
        weight = (wall.stiffness * wall.points.measure)[:, None] * wall.normal
        for mode in noise_modes(wall.rest, sd, length, 0.97).T:
            out.append(_on_nodes(scene, wall.points.nodes[:, 0], weight * mode[:, None]))
    return np.array(out)


def _sliding_forces(scene: GapScene, correlation_mm: float = NoiseSizes.along_correlation_mm) -> FloatArray:
    """(r, nodes, 3) mN: smooth shear tractions on the walls, which a sliding wall is taken not to have."""
    out = []
    for wall in scene.walls:
        tangent = np.eye(3) - wall.normal[:, :, None] * wall.normal[:, None, :]
        for mode in noise_modes(wall.rest, 1.0, correlation_mm, 0.9).T:
            for axis in range(3):
                traction = (wall.points.measure * mode)[:, None] * tangent[:, axis]
                out.append(_on_nodes(scene, wall.points.nodes[:, 0], traction))
    return np.array(out)


def _on_nodes(scene: GapScene, nodes: NDArray[np.int64], force: FloatArray) -> FloatArray:
    full = np.zeros((scene.space.n_nodes, 3))
    np.add.at(full, nodes, force)
    return full


def _along(scene: GapScene, sight: Sight, u: FloatArray, forces: FloatArray) -> FloatArray:
    """Covariance of the residual when every wall's motion along itself has a standard deviation of 1 mm (area mean)."""
    moves = response_to_forces(scene.assembler, forces)
    total = np.zeros((sight.n, sight.n))
    start = 0
    for wall in scene.walls:
        count = 3 * noise_modes(wall.rest, 1.0, NoiseSizes.along_correlation_mm, 0.9).shape[1]
        part = moves[start : start + count]
        start += count
        v = np.stack([wall.points.displacements(m) for m in part])
        v = v - np.einsum("rqi,qi->rq", v, wall.normal)[..., None] * wall.normal
        variance = float(np.average((v**2).sum(axis=(0, 2)), weights=wall.points.measure)) / 2.0
        R = sight.response(scene, u, part)
        total += R @ R.T / variance
    return total
