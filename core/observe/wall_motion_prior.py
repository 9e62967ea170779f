"""How smoothly and how far a wall moves along its normal: the likeliest kernel (type-II maximum likelihood)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.core.observe.wall_rigid_and_growth import WallRigidModes

# Lengths and standard deviations along the normal among which the likeliest is taken, mm.
LENGTHS_MM = (10.0, 12.0, 14.0, 17.0, 20.0, 24.0, 29.0, 35.0)
SIZES_MM = (1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 10.0)
# Of any other motion, an axis, mm. The data do not tell 0.3 from 1 (evidence of eight walls: 3448.1 and 3449.7 in all). Where up to 8 was
# allowed, a bladder drifted 11 mm along itself as normals were taken anew; with 1 and all axes alike, a rectum 5 mm.
SIDEWAYS_MM = 0.7


@dataclass(frozen=True)
class Kernel:
    """length, and size along the normal, mm."""

    length: float
    size: float


def likeliest(
    X: FloatArray, out: FloatArray, normal: FloatArray, shift: FloatArray, noise: FloatArray, whole: WallRigidModes
) -> Kernel:
    """The kernel under which motions shift (q,) mm along `normal` (q, 3) at X (q, 3) mm are likeliest (Rasmussen & Williams 2006, 5.4).

    normal, out (q, 3) : unit normals, deformed and at rest. noise (q, q) mm2 : of shift.
    Raises LinAlgError when noise is no covariance.
    """
    squared = cdist(X, X) ** 2
    turned, larger = (normal * out).sum(axis=1), (normal * whole.growth(X)).sum(axis=1)
    across = normal @ whole.axes
    straight, other = np.outer(turned, turned), across @ across.T
    known = noise + whole.moved_mm**2 * whole.together(X, X) * other + np.outer(larger, larger)
    best = (-np.inf, Kernel(LENGTHS_MM[0], SIZES_MM[0]))
    for length in LENGTHS_MM:
        near = np.exp(-0.5 * squared / length**2)
        rest = known + SIDEWAYS_MM**2 * near * other
        for size in SIZES_MM:
            L = np.linalg.cholesky(size**2 * near * straight + rest)
            white = solve_triangular(L, shift, lower=True, check_finite=False)
            likelihood = -0.5 * float(white @ white) - float(np.log(np.diag(L)).sum())
            if likelihood > best[0]:
                best = (likelihood, Kernel(length, size))
    return best[1]
