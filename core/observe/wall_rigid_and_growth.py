"""Rigid modes and growth in the prior of a wall's motion: a bag translates and grows, a tube translates section by
section."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.observe.wall_motion_options import WallMotionOptions


@dataclass(frozen=True, eq=False)
class WallRigidModes:
    """Low-order modes of a wall's motion, with the covariance that the prior gives them.

    axes (3, 3) : takes unit normal amplitudes to a translation over its standard deviation `translation_mm`.
    centre (3,) mm, radius (rms, mm) : of the wall at rest, about which a bag grows; a tube's radius is infinite, for it
    is cut where the scan ends and has no size of its own. along (3,) : unit axis of a tube, 0 for a bag.

    The standard deviations of the modes are options and not fitted: across the wall, where scans see it, these modes
    look like others, so that the likeliest standard deviation was often 0 and the tangential motion was then wrong.
    """

    axes: FloatArray
    centre: FloatArray
    radius: float
    along: FloatArray
    options: WallMotionOptions

    @classmethod
    def of(cls, points: FloatArray, normals: FloatArray, options: WallMotionOptions) -> WallRigidModes:
        """Modes of a wall at rest with points (q, 3) mm and unit normals (q, 3)."""
        axes, centre = force_covariance(normals), points.mean(axis=0)
        values, vectors = np.linalg.eigh(axes)
        if values[0] <= options.bag_share:
            return cls(axes, centre, np.inf, vectors[:, 0], options)
        radius = float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean()))
        return cls(axes, centre, radius, np.zeros(3), options)

    @property
    def translation_mm(self) -> float:
        """Standard deviation per axis of a bag's translation, or of the translations of a tube's sections, mm."""
        return self.options.bag_mm if np.isfinite(self.radius) else self.options.section_moved_mm

    def correlation(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Correlation (n, k) of the translations at x (n, 3) and y (k, 3) mm: along a tube it falls off, in a bag it is
        1."""
        apart = (x @ self.along)[:, None] - y @ self.along
        return np.asarray(np.exp(-0.5 * (apart / self.options.section_length_mm) ** 2))

    def growth(self, x: FloatArray) -> FloatArray:
        """Displacement (n, 3) mm at x (n, 3) mm for growth by one standard deviation; 0 for a tube."""
        return self.options.bag_mm * (x - self.centre) / self.radius


def force_covariance(normals: FloatArray) -> FloatArray:
    """Covariance (3, 3), scaled to a mean diagonal of 1, of the total force of independent pressures on a wall with
    unit normals (q, 3)."""
    return np.asarray(3.0 * normals.T @ normals / len(normals))
