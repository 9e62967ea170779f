"""The blind check's patients: one of its pelves, stretched and sheared differently in each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.volume import Volume
from palpate.simulate.wall_motion import WallMotion


class Anatomy(Protocol):
    """A body at rest that patients are made of."""

    @property
    def model_labels(self) -> Volume:
        """Labels to be meshed."""

    @property
    def label_grid(self) -> Volume:
        """Grid on which labels are written."""

    def labels(self, points: FloatArray) -> LabelArray:
        """Label (n,) of points (n, 3) mm at rest; 0 outside the modelled region."""


@dataclass(frozen=True, eq=False)
class Patient:
    """turn : (3, 3) takes the pelvis about `centre` (mm) to this patient."""

    source: Anatomy
    turn: FloatArray
    centre: FloatArray

    @classmethod
    def of(cls, source: Anatomy, rng: np.random.Generator) -> Patient:
        """Up to a tenth larger or smaller along each axis, sheared by up to 5 %."""
        turn = np.diag(rng.uniform(0.92, 1.1, 3)) + np.triu(rng.uniform(-0.05, 0.05, (3, 3)), 1)
        grid = source.label_grid
        middle = grid.to_lps(0.5 * (np.array(grid.array.shape, dtype=float) - 1.0)[None])[0]
        return cls(source, turn, middle)

    def made(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) mm of the pelvis in this patient."""
        return np.asarray((points - self.centre) @ self.turn.T + self.centre)

    def undone(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) mm of this patient in the pelvis."""
        return np.asarray((points - self.centre) @ np.linalg.inv(self.turn).T + self.centre)

    def labels(self, points: FloatArray) -> LabelArray:
        """Label (n,) of points (n, 3) mm at rest."""
        return self.source.labels(self.undone(points))

    @property
    def grid(self) -> Volume:
        """Grid that holds the modelled region."""
        return self.grid_of(self.source.label_grid.spacing)

    def grid_of(self, voxel_mm: tuple[float, float, float] | FloatArray) -> Volume:
        """Grid of such voxels that holds the modelled region."""
        plain, spacing = self.source.label_grid, np.asarray(voxel_mm)
        corners = plain.to_lps(
            np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * plain.array.shape
        )
        made = self.made(corners)
        low, high = made.min(axis=0), made.max(axis=0)
        return Volume.upright(low, spacing, np.ceil((high - low) / spacing) + 1)


@dataclass(frozen=True, eq=False)
class Carried:
    """A motion of the pelvis' wall, in a patient."""

    motion: WallMotion
    patient: Patient

    def displacement(self, points: FloatArray) -> FloatArray:
        """See `WallMotion.displacement`."""
        return np.asarray(self.motion.displacement(self.patient.undone(points)) @ self.patient.turn.T)


@dataclass(frozen=True, eq=False)
class Rigid:
    """Translation (3,) mm and rotation vector (3,) rad about a pivot (3,) mm; a motion like a wall's."""

    translation: FloatArray
    rotation: FloatArray
    pivot: FloatArray

    def displacement(self, points: FloatArray) -> FloatArray:
        """See `WallMotion.displacement`; Rodrigues' formula."""
        angle = float(np.linalg.norm(self.rotation))
        X = points - self.pivot
        axis = self.rotation / max(angle, 1e-12)
        turned = X * np.cos(angle) + np.cross(axis, X) * np.sin(angle) + np.outer(X @ axis, axis) * (1 - np.cos(angle))
        return np.asarray(turned - X + self.translation)
