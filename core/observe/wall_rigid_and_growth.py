"""How a wall may move as a whole: a bag shifts and grows, a tube shifts section by section."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray

# Standard deviations, mm an axis, of a bag's translation and of how far sections of a tube shift, together with those this near along the
# tube; of a bag's growth, rms. They are not asked of the data: across a wall they look like something else, the likeliest size was often 0,
# and the wall then moved otherwise along itself. On five effect-free cases whose walls' motions are known, 2 to 4 mm and 12 to 30 mm along
# a tube are much alike.
MOVED_MM, SECTION_MM, SECTION_LENGTH_MM, GROWN_MM = 2.0, 3.0, 15.0, 2.0
# A tube is cut where the scan ends: it has no size of its own. Of a bag, random pressures along any axis add up to at least this share of
# their mean.
BAG = 0.3


@dataclass(frozen=True, eq=False)
class WallRigidModes:
    """How a wall may move as a whole. axes (3, 3) : takes unit normal amplitudes to a translation, in its size.

    middle (3,) mm, radius mm : of the wall at rest, about which it grows; radius is rms, infinite for what is no bag. along (3,) : a tube's
    axis, 0 for a bag, which has no sections.
    """

    axes: FloatArray
    middle: FloatArray
    radius: float
    along: FloatArray

    @classmethod
    def of(cls, points: FloatArray, normals: FloatArray) -> WallRigidModes:
        """Of a wall at rest with these points and normals, (q, 3) each."""
        axes, middle = pushed(normals), points.mean(axis=0)
        values, vectors = np.linalg.eigh(axes)
        if values[0] <= BAG:
            return cls(axes, middle, np.inf, vectors[:, 0])
        return cls(axes, middle, float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean())), np.zeros(3))

    @property
    def moved_mm(self) -> float:
        """Standard deviation of its translation or its sections', an axis."""
        return MOVED_MM if np.isfinite(self.radius) else SECTION_MM

    def together(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """(n, k) correlation of the translations at x (n, 3) and y (k, 3)."""
        return np.asarray(np.exp(-0.5 * (((x @ self.along)[:, None] - y @ self.along) / SECTION_LENGTH_MM) ** 2))

    def growth(self, x: FloatArray) -> FloatArray:
        """(n, 3) mm at x (n, 3), of a standard deviation; 0 for a tube."""
        return GROWN_MM * (x - self.middle) / self.radius


def pushed(normals: FloatArray) -> FloatArray:
    """(3, 3) covariance, over its mean an axis, of the force that random pressures on a wall with normals (q, 3) add up to."""
    return np.asarray(3.0 * normals.T @ normals / len(normals))
