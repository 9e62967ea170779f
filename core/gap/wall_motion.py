"""How a wall moved along itself, which no scan shows: the smoothest motion that agrees with what is seen across it.

The wall's motion is a Gaussian process in space, one scalar process a component, with a squared-exponential kernel whose length and
size are those that make the motion seen along the normals most likely (type-II maximum likelihood; Rasmussen & Williams 2006, 5.4).
A wall that moves as a whole then drags the tissue at its sides along, where a frictionless one lets it stay behind: on the four
synthetic cases without an effect the predicted organ is wrong by 0.27, 0.33, 0.17 and 0.09 mm rms instead of 0.44, 0.46, 0.24, 0.10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.spatial.distance import cdist

from palpate.core.fem.terms.springs import Springs
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.observe.noise import noise_modes, smooth_covariance

FloatArray = NDArray[np.float64]

# Lengths and standard deviations among which the likeliest is taken, mm.
LENGTHS_MM = (10.0, 12.0, 14.0, 17.0, 20.0, 24.0, 29.0, 35.0)
SIZES_MM = (1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 10.0)
# Correlation length of the contours' noise, and what voxels add to it point by point, mm.
_NOISE_LENGTH_MM, _VOXELS_MM = 6.5, 0.15
# Points of a wall that its motion is learnt from, at most; kernel's share of variance that is kept.
POINTS, _SHARE = 400, 0.98
# Normals turn as the wall moves: how often they are taken anew.
_ROUNDS = 3
# Stiffness along the wall over the tissue's shear modulus, 1/mm: tissue moves a wall by some hundredths of a millimetre.
DRAG = 20.0


@dataclass(frozen=True, eq=False)
class WallMotion:
    """points (q, 3) mm the motion was learnt at; length, size : of the kernel, mm; basis (q, m) takes kernel values to modes.

    mean (m, 3), factor (m, 3, r) : of the modes' amplitudes; unit normal numbers (r,) times `factor` are what is left unknown.
    """

    points: FloatArray
    length: float
    size: float
    basis: FloatArray
    mean: FloatArray
    factor: FloatArray

    @classmethod
    def of(cls, wall: SlidingWall, noise_sd_mm: float) -> WallMotion:
        """From a wall at rest that lies where the first scan shows it; noise_sd_mm : of one contour."""
        chosen = np.random.default_rng(0).permutation(len(wall.rest))[:POINTS]
        X = wall.rest[chosen]
        noise = 2.0 * smooth_covariance(X, noise_sd_mm, _NOISE_LENGTH_MM) + _VOXELS_MM**2 * np.eye(len(X))
        v = np.zeros_like(wall.rest)
        for k in range(_ROUNDS):
            seen = wall.linearised_at(v)
            normal, shift = seen.normal[chosen], seen.shift[chosen]
            if k < _ROUNDS - 1:
                length, size = likeliest(X, normal, shift, noise)
            found = _posterior(X, normal, shift, noise, length, size)
            v = found.at(wall.rest)
        return found

    def at(self, x: FloatArray) -> FloatArray:
        """(n, 3) mm, the likeliest motion at x (n, 3)."""
        return np.asarray(self._modes(x) @ self.mean)

    def unknown_at(self, x: FloatArray) -> FloatArray:
        """(r, n, 3) mm: motions whose sum with unit normal amplitudes is what is not known at x (n, 3)."""
        return np.einsum("nm,mir->rni", self._modes(x), self.factor, optimize=True)

    def _modes(self, x: FloatArray) -> FloatArray:
        return np.asarray(self.size**2 * np.exp(-0.5 * (cdist(x, self.points) / self.length) ** 2) @ self.basis)

    def drag(self, wall: SlidingWall, shift: FloatArray, u: FloatArray, way: float, shear_kpa: float) -> Springs:
        """Springs that take a wall along itself to where this motion has it.

        shift : (q, 3) mm from the scanned to the stress-free rest position of its points. u : nodal displacements (n, 3) the wall is
        linearised at. way : how much of the remaining distance to ask for. shear_kpa : the tissue's modulus.
        """
        now = wall.points.displacements(u)
        target = now + way * (self.at(wall.rest - shift) - shift - now)
        along = np.eye(3) - wall.normal[:, :, None] * wall.normal[:, None, :]
        return Springs(wall.points, DRAG * shear_kpa * along, target)


def likeliest(X: FloatArray, normal: FloatArray, shift: FloatArray, noise: FloatArray) -> tuple[float, float]:
    """Length and size (mm) of the kernel under which normal motions shift (q,) at X (q, 3) are likeliest."""
    seen_together = normal @ normal.T
    squared = cdist(X, X) ** 2
    best = (-np.inf, LENGTHS_MM[0], SIZES_MM[0])
    for length in LENGTHS_MM:
        kernel = np.exp(-0.5 * squared / length**2) * seen_together
        for size in SIZES_MM:
            L = np.linalg.cholesky(size**2 * kernel + noise)
            white = solve_triangular(L, shift, lower=True)
            best = max(best, (-0.5 * float(white @ white) - float(np.log(np.diag(L)).sum()), length, size))
    return best[1], best[2]


def _posterior(
    X: FloatArray, normal: FloatArray, shift: FloatArray, noise: FloatArray, length: float, size: float
) -> WallMotion:
    modes = noise_modes(X, size, length, _SHARE)
    m = modes.shape[1]
    basis = modes / np.maximum((modes**2).sum(axis=0), 1e-30)
    A = (modes[:, :, None] * normal[:, None, :]).reshape(len(X), 3 * m)
    weighed = cho_solve(cho_factor(noise, lower=True), A)
    precision = np.eye(3 * m) + A.T @ weighed
    mean = np.linalg.solve(precision, weighed.T @ shift)
    factor = np.linalg.inv(np.linalg.cholesky(precision)).T
    return WallMotion(X, length, size, basis, mean.reshape(m, 3), factor.reshape(m, 3, -1))
