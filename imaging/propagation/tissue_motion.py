"""The motion of tissue that windows' motions make likely, and how far it may be off anywhere."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve, cholesky, solve_triangular

from palpate.core.arrays import FloatArray
from palpate.imaging.propagation.motion_prior import MotionPrior, Sizes, Walls
from palpate.imaging.propagation.options import PropagationOptions
from palpate.imaging.propagation.window_motions import WindowMotions

# Points that are asked at once, rounds in which sizes are chosen one after the other, and standard deviations from which on a
# window contradicts the others.
_AT_ONCE, _ROUNDS, _FAR_OFF = 4000, 2, 4.0


@dataclass(frozen=True, eq=False)
class TissueMotion:
    """Posterior of the displacement: a Gaussian process regression (kriging) of the windows' motions.

    A window's motion is a mean over it: what strain leaves of that, strain times the window's size, counts as noise.
    """

    prior: MotionPrior
    data: WindowMotions

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
        """What each window's motion differs by from the posterior's (n,), over its noise."""
        return np.asarray(self._weights * np.sqrt(_noise(self.data, self.prior.options)))

    @cached_property
    def _factor(self) -> tuple[FloatArray, bool]:
        factor, lower = cho_factor(_covariance(self.prior, self.data), lower=True, overwrite_a=True, check_finite=False)
        return factor, bool(lower)

    @cached_property
    def _weights(self) -> FloatArray:
        return np.asarray(cho_solve(self._factor, self.data.along_mm))


def tissue_motion(data: WindowMotions, walls: Walls, options: PropagationOptions) -> TissueMotion:
    """The motion whose sizes make the windows' motions likeliest; windows that contradict the others are left out."""
    used = data.at_most(options.most_windows)
    prior = _likeliest(used.at_most(options.asked_windows), walls, options)
    first = TissueMotion(prior, used)
    agree = np.abs(first.unlike) < _FAR_OFF
    return first if agree.all() else TissueMotion(prior, used.chosen(agree))


def _likeliest(data: WindowMotions, walls: Walls, options: PropagationOptions) -> MotionPrior:
    """Sizes chosen one after the other by marginal likelihood (Rasmussen and Williams 2006, Eq 5.8)."""
    middle = Sizes(options.far_sizes_mm[len(options.far_sizes_mm) // 2], tuple(2.4 for _ in walls.surfaces))
    best = MotionPrior(walls, middle, options)
    known = _log_likelihood(best, data)
    for _ in range(_ROUNDS):
        before = best.sizes
        for which in range(1 + len(walls.surfaces)):
            for size in options.far_sizes_mm if which == 0 else options.wall_sizes_mm:
                other = replace(best, sizes=_with(best.sizes, which, size))
                likely = _log_likelihood(other, data)
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


def _log_likelihood(prior: MotionPrior, data: WindowMotions) -> float:
    try:
        factor = cholesky(_covariance(prior, data), lower=True, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return -np.inf
    white = solve_triangular(factor, data.along_mm, lower=True, check_finite=False)
    return float(-0.5 * white @ white - np.log(np.diag(factor)).sum())


def _covariance(prior: MotionPrior, data: WindowMotions) -> FloatArray:
    out = prior.along(data.points, data.directions, data.points, data.directions)
    out[np.diag_indices(len(out))] += _noise(data, prior.options)
    return out


def _noise(data: WindowMotions, options: PropagationOptions) -> FloatArray:
    return data.variance_mm2 + (options.strain * options.window_mm) ** 2
