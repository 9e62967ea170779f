"""The motion of tissue that measured displacements make likely, and how far it may be off anywhere."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve, cholesky, solve_triangular

from palpate.core.arrays import FloatArray
from palpate.imaging.propagation.displacements import Displacements
from palpate.imaging.propagation.motion_prior import MotionPrior, Sizes, Walls
from palpate.imaging.propagation.options import PropagationOptions

# Points that are asked at once, rounds in which sizes are chosen one after the other, and standard deviations from which on a
# displacement contradicts the others.
_AT_ONCE, _ROUNDS, _FAR_OFF = 4000, 2, 4.0


@dataclass(frozen=True, eq=False)
class TissueMotion:
    """Posterior of the displacement: a Gaussian process regression (kriging) of measured displacements."""

    prior: MotionPrior
    data: Displacements

    def at(self, points: FloatArray) -> FloatArray:
        """Displacements (n, 3) mm at points (n, 3) mm."""
        d = self.data
        parts = np.array_split(points, 1 + len(points) // _AT_ONCE)
        return np.vstack([self.prior.applied(part, d.points, d.directions, self._weights) for part in parts])

    def error(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        """Standard deviation (n,) mm of the displacement along directions (n, 3)."""
        d = self.data
        shared = self.prior.along(points, directions, d.points, d.directions)
        told = np.einsum("nm,mn->n", shared, cho_solve(self._factor, shared.T))
        return np.sqrt(np.maximum(self.prior.variance(points, directions) - told, 0.0))

    @cached_property
    def unlike(self) -> FloatArray:
        """What each displacement differs by from the posterior's (n,), over its error."""
        error = self.data.covariance
        return np.asarray((error @ self._weights) / np.sqrt(np.diag(error)))

    @cached_property
    def _factor(self) -> tuple[FloatArray, bool]:
        factor, lower = cho_factor(_covariance(self.prior, self.data), lower=True, overwrite_a=True, check_finite=False)
        return factor, bool(lower)

    @cached_property
    def _weights(self) -> FloatArray:
        return np.asarray(cho_solve(self._factor, self.data.along_mm))


def tissue_motion(data: Displacements, walls: Walls, options: PropagationOptions) -> TissueMotion:
    """The motion whose sizes make the displacements likeliest; those that contradict the others are left out."""
    used = data.at_most(options.most_windows)
    prior = _likeliest(used.at_most(options.asked_windows), walls, options)
    first = TissueMotion(prior, used)
    agree = np.abs(first.unlike) < _FAR_OFF
    return first if agree.all() else TissueMotion(prior, used.chosen(agree))


def usual_motion(data: Displacements, walls: Walls, options: PropagationOptions) -> TissueMotion:
    """The motion with sizes that are usual, at once."""
    return TissueMotion(_usual(walls, options), data.at_most(options.asked_windows))


def _usual(walls: Walls, options: PropagationOptions) -> MotionPrior:
    far, of_walls = (sizes[len(sizes) // 2] for sizes in (options.far_sizes_mm, options.wall_sizes_mm))
    return MotionPrior(walls, Sizes(far, tuple(of_walls for _ in walls.surfaces)), options)


def _likeliest(data: Displacements, walls: Walls, options: PropagationOptions) -> MotionPrior:
    """Sizes chosen one after the other by marginal likelihood (Rasmussen and Williams 2006, Eq 5.8)."""
    best = _usual(walls, options)
    parts = list(best.parts(data.points, data.directions, data.points, data.directions))
    known = _log_likelihood(best, parts, data)
    for _ in range(_ROUNDS):
        before = best.sizes
        for which in range(1 + len(walls.surfaces)):
            for size in options.far_sizes_mm if which == 0 else options.wall_sizes_mm:
                other = replace(best, sizes=_with(best.sizes, which, size))
                likely = _log_likelihood(other, parts, data)
                if likely > known:
                    best, known = other, likely
        if best.sizes == before:
            break
    return best


def _with(sizes: Sizes, which: int, size: float) -> Sizes:
    if which == 0:
        return replace(sizes, far_mm=size)
    walls = tuple(size if number == which - 1 else old for number, old in enumerate(sizes.walls_mm))
    return replace(sizes, walls_mm=walls)


def _log_likelihood(prior: MotionPrior, parts: list[FloatArray], data: Displacements) -> float:
    """parts : see `MotionPrior.parts`; with any sizes."""
    covariance = data.covariance
    for variance, part in zip(prior.variances, parts, strict=True):
        covariance += variance * part
    try:
        factor = cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return -np.inf
    white = solve_triangular(factor, data.along_mm, lower=True, check_finite=False)
    return float(-0.5 * white @ white - np.log(np.diag(factor)).sum())


def _covariance(prior: MotionPrior, data: Displacements) -> FloatArray:
    return prior.along(data.points, data.directions, data.points, data.directions) + data.covariance
