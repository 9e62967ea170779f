"""What a wall without friction slides farther along itself than its likeliest motion.

A pair of scans shows the motion across a wall only. Along it the wall may go with what moves it (its likeliest motion),
or the tissue beside it may take it where it costs the least energy (no friction). The motion along the wall is taken to
be the likeliest one plus a share s of the difference, with mean 1/2 and standard deviation 1/2: both ends are one
standard deviation away. The data tell s together with the stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray

# Neighbours whose mean, by inverse squared distance, is the slip between the points where it is known.
_NEIGHBOURS = 4


@dataclass(frozen=True, eq=False)
class WallSlip:
    """points (q, 3) mm of the wall at rest. half (q, 3) mm : half of the difference there, along the wall.

    factor : how many of them the wall is taken to slide, 1 before the data are asked.
    """

    points: FloatArray
    half: FloatArray
    factor: float = 1.0

    def at(self, x: FloatArray) -> FloatArray:
        """Half of the difference (n, 3) mm at x (n, 3) mm."""
        k = min(_NEIGHBOURS, len(self.points))
        distance, nearest = cKDTree(self.points).query(x, k=list(range(1, k + 1)))
        weight = 1.0 / np.maximum(distance, 1e-3) ** 2
        return np.asarray((weight[..., None] * self.half[nearest]).sum(axis=1) / weight.sum(axis=1)[:, None])
