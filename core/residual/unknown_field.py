"""Discrepancy without a name: smooth missing forces around the organ, and smooth errors of its contour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.sensitivity import response_to_forces
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.observe.contour_noise import noise_modes
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.joint_states import JointLinearisation, apart
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.residual.noise_model_options import NoiseModelOptions

# Shares of the variance of forces and of shapes whose modes are taken: truncations.
_FORCES_KEPT, _SHAPES_KEPT = 0.9, 0.97


@dataclass(frozen=True, eq=False)
class ForceFields:
    """Basis of smooth missing forces in one deformed state, and of smooth contour errors beside them.

    fields (k, nodes, 3) mN : nodal forces. Amplitudes that are independent standard normal move the surface by
    `NoiseModelOptions.force_typical_mm` (rms). response (n, k) mm : of the residual, per unit amplitude. shapes (n, m)
    mm : response to smooth errors of the contour, which no force explains. share (nodes,) mm3 : volume of each node.
    """

    fields: FloatArray
    response: FloatArray
    shapes: FloatArray
    share: FloatArray

    @classmethod
    def around(cls, linearisation: Linearisation, data: DataVector, options: NoiseModelOptions) -> ForceFields:
        """Basis for the equilibrium of a linearisation, within `options.force_length_mm` of the organ's surface."""
        scene = linearisation.scene
        mesh, nodes = scene.space.mesh, scene.space.nodes
        share = np.zeros(len(nodes))
        np.add.at(share, mesh.cells, np.repeat(mesh.volumes[:, None] / 4.0, 4, axis=1))
        organ = scene.observation.points
        reach = options.force_length_mm
        low, high = organ.min(axis=0) - reach, organ.max(axis=0) + reach
        near = np.flatnonzero(((nodes > low) & (nodes < high)).all(axis=1))
        modes = noise_modes(nodes[near], 1.0, options.force_length_mm, _FORCES_KEPT)
        fields = np.zeros((3 * modes.shape[1], len(nodes), 3))
        for j, mode in enumerate(modes.T):
            for axis in range(3):
                fields[3 * j + axis, near, axis] = mode * share[near]
        moves = response_to_forces(linearisation.tangent, fields)
        response = data.response(scene, linearisation.equilibrium.u, moves)
        size = _surface_rms(scene, data, response, moves)
        scale = options.force_typical_mm / max(size, 1e-30)
        return cls(fields * scale, response * scale, contour_shapes(organ, data, options), share)

    def force_density(self, amplitudes: FloatArray) -> FloatArray:
        """Force density (nodes, 3) kPa/mm for amplitudes (k,)."""
        total = np.einsum("k,kni->ni", amplitudes, self.fields)
        return total / np.maximum(self.share, 1e-30)[:, None]


@dataclass(frozen=True, eq=False)
class UnknownDiscrepancy:
    """Forces and shapes of every deformed state, independent between states."""

    each: tuple[ForceFields, ...]

    @classmethod
    def around(
        cls, points: JointLinearisation, data_vectors: Sequence[DataVector], options: NoiseModelOptions
    ) -> UnknownDiscrepancy:
        """At points, one for each state."""
        return cls(tuple(ForceFields.around(p, s, options) for p, s in zip(points.each, data_vectors, strict=True)))

    @cached_property
    def response(self) -> FloatArray:
        """Response (n, k) of the residual to the forces of all states."""
        return apart([f.response for f in self.each])

    @cached_property
    def free(self) -> FloatArray:
        """Response (n, k + m) of the residual to forces and shapes."""
        return np.hstack([self.response, apart([f.shapes for f in self.each])])


def _surface_rms(scene: CompositionScene, data: DataVector, response: FloatArray, moves: FloatArray) -> float:
    """Motion of the organ's surface along its normal, mm rms, for independent unit amplitudes of moves (k, nodes, 3) mm."""
    observation = scene.observation
    if data.n_modes:
        return float(np.sqrt((response[: data.n_modes] ** 2).sum() / len(observation.points)))
    along = [((observation.operator @ move) * observation.normals).sum(axis=1) for move in moves]
    return float(np.sqrt(np.square(along).sum() / len(observation.points)))


def contour_shapes(organ: FloatArray, data: DataVector, options: NoiseModelOptions) -> FloatArray:
    """Response (n, m) of the residual to smooth errors of a contour with points organ (q, 3) mm, of a typical
    discrepancy's size."""
    modes = noise_modes(organ, options.force_typical_mm, options.shape_length_mm, _SHAPES_KEPT)
    shapes = np.zeros((data.n, modes.shape[1]))
    shapes[: data.n_modes] = data.modes.T @ modes
    return shapes
