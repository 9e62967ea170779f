"""Data vector of a deformed state: smooth modes of the organ's surface, landmarks, matched motion, bones' motion.

Contour noise is correlated over millimetres, so that 1,300 surface points are some tens of independent observations.
The surface residual is therefore projected on the leading modes of the noise's own covariance; the remainder is finer
than any effect.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from palpate.core.arrays import FloatArray
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.forward.composition import Composition
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.observe.bone_registration import BoneRegistration
from palpate.core.observe.contour_noise import leading_eigenpairs, smooth_covariance
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.residual.noise_model_options import NoiseModelOptions


@dataclass(frozen=True, eq=False)
class DataVector:
    """What one deformed state shows. modes (q, k) : orthonormal, none where nobody drew the organ there. n_marks : landmarks.

    bone : None where no bones are seen. motion_covariance (m, m) : of the modes of the motion that the images tell, none
    without images."""

    modes: FloatArray
    n_marks: int
    bone: BoneRegistration | None
    motion_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def of(
        cls,
        observation: SurfaceObservation,
        bone: BoneRegistration | None,
        options: NoiseModelOptions,
        organ_drawn: bool = True,
    ) -> DataVector:
        """The modes of an observation's points, where the deformed organ was drawn."""
        values, vectors = leading_eigenpairs(smooth_covariance(observation.points, 1.0, options.mode_length_mm))
        modes = np.ascontiguousarray(vectors[:, organ_drawn & (values > options.mode_least * values[0])])
        return cls(modes, len(observation.landmarks), bone, observation.motion.covariance)

    @property
    def n_modes(self) -> int:
        """Number of surface modes."""
        return self.modes.shape[1]

    @property
    def n(self) -> int:
        """Length of the data vector."""
        return self.motion.stop + (6 if self.bone else 0)

    @property
    def dilation(self) -> FloatArray:
        """Change (n,) of the residual when the whole contour is 1 mm wider."""
        out = np.zeros(self.n)
        out[: self.n_modes] = self.modes.sum(axis=0)
        return out

    @property
    def marks(self) -> slice:
        """Rows of the landmarks in the data vector."""
        return slice(self.n_modes, self.n_modes + 3 * self.n_marks)

    @property
    def n_motion(self) -> int:
        """Number of modes of the motion that the images tell."""
        return len(self.motion_covariance)

    @property
    def motion(self) -> slice:
        """Rows of the motion that the images tell."""
        return slice(self.marks.stop, self.marks.stop + self.n_motion)

    def residual(self, scene: CompositionScene, u: FloatArray) -> FloatArray:
        """Predicted minus observed data (n,), for nodal displacements u (nodes, 3) mm of the scene."""
        observation, composition = scene.observation, scene.composition
        return self.residual_of(observation, observation.all_points @ scene.seen(u), composition)

    def residual_of(
        self, observation: SurfaceObservation, v: FloatArray, composition: Composition | None = None
    ) -> FloatArray:
        """The same (n,) for displacements v (p, 3) mm of `observation.all_points`.

        composition : whose bones moved, and whose contour is offset; None for the plain model.
        """
        surface, marks, motion = observation.parts_of(v)
        distance = observation.residual_of(surface)
        if composition is not None:
            distance = distance + composition.observation
        parts = [self.modes.T @ distance, (observation.landmarks[:, :3] + marks - observation.landmarks[:, 3:]).ravel()]
        parts.append(observation.motion.residual_of(motion))
        if self.bone is not None:
            if composition is None or not composition.support:
                parts.append(self.bone.residual_at_rest)
            else:
                parts.append(self.bone.residual(composition.bone_motion))
        return np.concatenate(parts)

    def response(self, scene: CompositionScene, u: FloatArray, moves: FloatArray) -> FloatArray:
        """Change (n, r) of the residual for changes of displacement `moves` (r, nodes, 3) mm at u (nodes, 3) mm."""
        every = scene.observation.all_points
        moved = np.stack([every @ m for m in moves]) if len(moves) else np.zeros((0, every.shape[0], 3))
        return self.response_of(scene.observation, every @ scene.seen(u), moved)

    def response_of(self, observation: SurfaceObservation, v: FloatArray, moves: FloatArray) -> FloatArray:
        """The same (n, r) for changes `moves` (r, p, 3) mm of the displacements v (p, 3) mm of `observation.all_points`."""
        _, normal = observation.target.value_and_gradient(observation.points + observation.parts_of(v)[0])
        out = np.zeros((self.n, len(moves)))
        for j, move in enumerate(moves):
            surface, marks, motion = observation.parts_of(move)
            out[: self.n_modes, j] = self.modes.T @ (surface * normal).sum(axis=1)
            out[self.marks, j] = marks.ravel()
            out[self.motion, j] = observation.motion.modes_of(motion)
        return out

    def in_theta(
        self, scene: CompositionScene, theta: FloatArray, equilibrium: Equilibrium, sensitivities: FloatArray
    ) -> FloatArray:
        """Derivative (n, t) of the residual in theta (t,), where the scene's equilibrium changes by `sensitivities` (t,
        nodes, 3) mm."""
        return self.response(scene, equilibrium.u, sensitivities)

    def loads(self, scene: CompositionScene, u: FloatArray) -> FloatArray:
        """Derivative (n, nodes, 3) of the residual in nodal displacements, at u (nodes, 3) mm.

        Read as nodal forces these are the loads of the adjoint problems: the body's response to row i is the change of
        datum i per unit force at every node, for the tangent is symmetric (Maxwell and Betti).
        """
        observation = scene.observation
        rows = self.per_place(scene, u)
        contours = sp.vstack([observation.operator, observation.landmark_operator]).tocsr()
        seen = contours.shape[0]
        out = np.stack([(contours.T @ rows[:, :seen, i].T).T for i in range(3)], axis=2)
        out[self.motion] = observation.motion.per_node
        return out

    def per_place(self, scene: CompositionScene, u: FloatArray) -> FloatArray:
        """Derivative (n, q + k + w, 3) of the residual in displacements about `observation.every_place`, at u (nodes, 3) mm;
        that of matched motion is `MotionObservation.per_place`."""
        observation = scene.observation
        _, normal = observation.residual_and_normal(scene.seen(u))
        q, rows = len(observation.points), np.zeros((self.n, len(observation.every_place), 3))
        rows[: self.n_modes, :q] = self.modes.T[:, :, None] * normal
        for k in range(3 * self.n_marks):
            rows[self.marks.start + k, q + k // 3, k % 3] = 1.0
        rows[self.motion, q + self.n_marks :] = observation.motion.per_place
        return rows
