"""Data vector of a deformed state: smooth modes of the organ's surface, landmarks, matched motion, bones' motion.

Contour noise is correlated over millimetres, so that 1,300 surface points are some tens of independent observations.
The surface residual is therefore projected on the leading modes of the noise's own covariance; the remainder is finer
than any effect.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.observe.bone_registration import BoneRegistration
from palpate.core.observe.contour_noise import smooth_covariance
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.residual.noise_model_options import NoiseModelOptions


@dataclass(frozen=True, eq=False)
class DataVector:
    """What one deformed state shows. modes (q, k) : orthonormal. n_marks : landmarks. bone : None where no bones are
    seen. motion_covariance (m, m) : of the modes of the motion that the images tell, none without images."""

    modes: FloatArray
    n_marks: int
    bone: BoneRegistration | None
    motion_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def of(
        cls, observation: SurfaceObservation, bone: BoneRegistration | None, options: NoiseModelOptions
    ) -> DataVector:
        """The modes of an observation's points."""
        values, vectors = np.linalg.eigh(smooth_covariance(observation.points, 1.0, options.mode_length_mm))
        kept = values > options.mode_least * values[-1]
        modes = np.ascontiguousarray(vectors[:, kept][:, ::-1])
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
    def wider(self) -> FloatArray:
        """Change (n,) of the residual when the whole contour is 1 mm wider."""
        out = np.zeros(self.n)
        out[: self.n_modes] = self.modes.sum(axis=0)
        return out

    @property
    def marks(self) -> slice:
        """Rows of the landmarks in the data vector."""
        return slice(self.n_modes, self.n_modes + 3 * self.n_marks)

    @property
    def motion(self) -> slice:
        """Rows of the motion that the images tell."""
        return slice(self.marks.stop, self.marks.stop + len(self.motion_covariance))

    def residual(self, scene: CompositionScene, u: FloatArray) -> FloatArray:
        """Predicted minus observed data (n,), for nodal displacements u (nodes, 3) mm of the scene."""
        observed_u = scene.seen(u)
        surface = self.modes.T @ self.surface_residual(scene, u)
        parts = [surface, scene.observation.landmark_residual(observed_u).ravel()]
        parts.append(scene.observation.motion.residual(observed_u))
        if self.bone is not None:
            parts.append(self.bone.residual(scene.composition.bone_motion))
        return np.concatenate(parts)

    def surface_residual(self, scene: CompositionScene, u: FloatArray) -> FloatArray:
        """Predicted minus observed distance (q,) mm along the normal, at every point."""
        return scene.observation.residual(scene.seen(u)) + scene.composition.observation

    def response(self, scene: CompositionScene, u: FloatArray, moves: FloatArray) -> FloatArray:
        """Change (n, r) of the residual for changes of displacement `moves` (r, nodes, 3) mm at u (nodes, 3) mm."""
        observed_u = scene.seen(u)
        rows = [self.modes.T @ scene.observation.jacobian(observed_u, moves)]
        rows.append(np.stack([(scene.observation.landmark_operator @ m).ravel() for m in moves], axis=1))
        rows.append(scene.observation.motion.jacobian(moves))
        if self.bone is not None:
            rows.append(np.zeros((6, len(moves))))
        return np.vstack(rows)
