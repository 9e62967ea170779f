"""How a wall may move as a whole: a bag shifts and grows, a tube shifts section by section."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.observe.wall_motion_options import WallMotionOptions


@dataclass(frozen=True, eq=False)
class WallRigidModes:
    """How a wall may move as a whole. axes (3, 3) : takes unit normal amplitudes to a translation, in its size.

    middle (3,) mm, radius mm : of the wall at rest, about which it grows; radius is rms, infinite for what is no bag: a tube is cut where
    the scan ends and has no size of its own. along (3,) : a tube's axis, 0 for a bag, which has no sections. How far the modes go is not
    asked of the data: across a wall they look like something else, the likeliest size was often 0, and the wall then moved otherwise along
    itself.
    """

    axes: FloatArray
    middle: FloatArray
    radius: float
    along: FloatArray
    options: WallMotionOptions

    @classmethod
    def of(cls, points: FloatArray, normals: FloatArray, options: WallMotionOptions) -> WallRigidModes:
        """Of a wall at rest with these points and normals, (q, 3) each."""
        axes, middle = pushed(normals), points.mean(axis=0)
        values, vectors = np.linalg.eigh(axes)
        if values[0] <= options.bag_share:
            return cls(axes, middle, np.inf, vectors[:, 0], options)
        radius = float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean()))
        return cls(axes, middle, radius, np.zeros(3), options)

    @property
    def moved_mm(self) -> float:
        """Standard deviation of its translation or its sections', an axis."""
        return self.options.bag_moved_mm if np.isfinite(self.radius) else self.options.section_moved_mm

    def together(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """(n, k) correlation of the translations at x (n, 3) and y (k, 3)."""
        apart = (x @ self.along)[:, None] - y @ self.along
        return np.asarray(np.exp(-0.5 * (apart / self.options.section_length_mm) ** 2))

    def growth(self, x: FloatArray) -> FloatArray:
        """(n, 3) mm at x (n, 3), of a standard deviation; 0 for a tube."""
        return self.options.bag_grown_mm * (x - self.middle) / self.radius


def pushed(normals: FloatArray) -> FloatArray:
    """(3, 3) covariance, over its mean an axis, of the force that random pressures on a wall with normals (q, 3) add up to."""
    return np.asarray(3.0 * normals.T @ normals / len(normals))
