"""How a wall moved along itself, which no scan shows: mostly straight out or in, as pressure moves it, and smoothly.

What fills or leaves a hollow organ presses along its wall's normal. The wall's motion is therefore a Gaussian process in space,
v = a n + t + g + w: a scalar process a along the normal n of the wall at rest, a translation t, of a bag as a whole and of a tube
section by section, the growth g of a bag to another size of the same shape, and a little, w, for whatever else moves it. Random
pressures on a wall add up to a force whose covariance is the mean of n n'; t and w go as far along an axis as that says, so that a
tube hardly moves along its own, where nothing pushes it and no scan would show it. a and w have a squared-exponential kernel of one
length; that and the size of a are those that make what is seen across the wall most likely (type-II maximum likelihood; Rasmussen &
Williams 2006, 5.4). How far t and g may go is not asked of the data: across the wall a shift looks like a swelling to one side, and the
likeliest size is often 0. Large parts of a wall may besides have slid along themselves together, pushed by what no scan shows: that
moves no expectation, but is unknown and so noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.core.fem.terms.springs import Springs
from palpate.core.fem.terms.wall import DistanceFunction, SlidingWall
from palpate.core.observe.contour_noise import noise_modes, smooth_covariance
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.observe.wall_motion_prior import Kernel, likeliest
from palpate.core.observe.wall_rigid_and_growth import WallRigidModes

# Resolution: points of a wall that its motion is learnt from, and the kernel's sizes alone, at most; share of the kernel's variance that is
# kept.
POINTS, _FEWER, _SHARE = 400, 200, 0.98


@dataclass(frozen=True, eq=False)
class WallMotion:
    """points (q, 3) mm the motion was learnt at; at_rest : signed distance of the wall at rest, whose gradient is its normal.

    whole : t and g; w has its axes too. basis (q, m) takes kernel values to modes, sections (q, s) those along a tube, slides (q, w)
    those of large parts. mean (a,), factor (a, r) : of a = 4 m + 3 s + 1 amplitudes, of the modes along the normal and along the axes,
    of the translations and the growth; unit normal numbers (r,) times `factor` are what is left unknown.
    """

    points: FloatArray
    at_rest: DistanceFunction
    kernel: Kernel
    whole: WallRigidModes
    basis: FloatArray
    sections: FloatArray
    slides: FloatArray
    mean: FloatArray
    factor: FloatArray

    @classmethod
    def of(
        cls, wall: SlidingWall, at_rest: DistanceFunction, noise_sd_mm: float, options: WallMotionOptions
    ) -> WallMotion:
        """From a wall at rest that lies where the first scan shows it; noise_sd_mm : of one contour."""
        chosen = np.random.default_rng(0).permutation(len(wall.rest))[:POINTS]
        X = wall.rest[chosen]
        out = _normals(at_rest, X)
        noise = 2.0 * smooth_covariance(X, noise_sd_mm, options.noise_length_mm)
        noise += options.voxels_mm**2 * np.eye(len(X))
        whole = WallRigidModes.of(wall.rest, _normals(at_rest, wall.rest), options)
        few = slice(None, None, -(-len(X) // _FEWER))
        near = np.exp(-0.5 * (cdist(X, X) / options.smooth_mm) ** 2)
        v, off = np.zeros_like(wall.rest), np.zeros(len(X))
        for k in range(options.rounds):
            seen = wall.linearised_at(v)
            normal, shift = seen.normal[chosen], seen.shift[chosen]
            if k > 0:  # at rest a point may lie far from where the wall went, and its neighbours see other parts of it
                normal, shift = _smoothed(near, v[chosen], normal, shift)
            trusted = _trusted(noise, off, options.cauchy)
            kernel = likeliest(X[few], out[few], normal[few], shift[few], trusted[few, few], whole)
            found = _posterior(X, at_rest, normal, shift, trusted, kernel, whole)
            v = found.at(wall.rest)
            off = shift - (normal * v[chosen]).sum(axis=1)
        return found

    def at(self, x: FloatArray) -> FloatArray:
        """(n, 3) mm, the likeliest motion at x (n, 3)."""
        return np.asarray(self._motions(x) @ self.mean)

    @property
    def options(self) -> WallMotionOptions:
        """What was taken to be known of the wall."""
        return self.whole.options

    @property
    def slide_mm(self) -> float:
        """Standard deviation of a slide, an axis."""
        return self.options.slide_share * float(np.sqrt((self.at(self.points) ** 2).sum(axis=1).mean()))

    def unknown_at(self, x: FloatArray) -> FloatArray:
        """(r, n, 3) mm: motions whose sum with unit normal amplitudes is what is not known at x (n, 3), slides included."""
        parts = np.exp(-0.5 * (cdist(x, self.points) / self.options.slide_length_mm) ** 2) @ self.slides
        slides = np.einsum("nm,ik->mkni", self.slide_mm * parts, np.eye(3)).reshape(-1, len(x), 3)
        return np.concatenate([np.moveaxis(self._motions(x) @ self.factor, 2, 0), slides])

    def _motions(self, x: FloatArray) -> FloatArray:
        """(n, 3, a) mm at x (n, 3) for unit amplitudes."""
        modes = np.exp(-0.5 * (cdist(x, self.points) / self.kernel.length) ** 2) @ self.basis
        along = self.kernel.size * _normals(self.at_rest, x)[:, :, None]
        axes = np.tile(self.whole.axes, (len(x), 1, 1))
        ways = np.concatenate([along, self.options.sideways_mm * axes], axis=2)
        smooth = np.einsum("nik,nm->nikm", ways, modes).reshape(len(x), 3, -1)
        grown = self.whole.growth(x)[:, :, None]
        shifts = self.whole.together(x, self.points) @ self.sections
        moved = np.einsum("nik,ns->niks", self.whole.moved_mm * axes, shifts).reshape(len(x), 3, -1)
        return np.concatenate([smooth, moved, grown], axis=2)

    def drag(self, wall: SlidingWall, shift: FloatArray, u: FloatArray, way: float, shear_kpa: float) -> Springs:
        """Springs that take a wall along itself to where this motion has it.

        shift : (q, 3) mm from the scanned to the stress-free rest position of its points. u : nodal displacements (n, 3) the wall is
        linearised at. way : how much of the remaining distance to ask for. shear_kpa : the tissue's modulus.
        """
        now = wall.points.displacements(u)
        target = now + way * (self.at(wall.rest - shift) - shift - now)
        along = np.eye(3) - wall.normal[:, :, None] * wall.normal[:, None, :]
        return Springs(wall.points, self.options.drag_per_mm * shear_kpa * along, target)


def _posterior(
    X: FloatArray,
    at_rest: DistanceFunction,
    normal: FloatArray,
    shift: FloatArray,
    noise: FloatArray,
    kernel: Kernel,
    whole: WallRigidModes,
) -> WallMotion:
    basis, slides = (_basis(X, length) for length in (kernel.length, whole.options.slide_length_mm))
    sections = _basis(np.outer(X @ whole.along, whole.along), whole.options.section_length_mm)
    nothing = np.zeros(0)
    motions = WallMotion(X, at_rest, kernel, whole, basis, sections, slides, nothing, nothing)._motions(X)
    A = np.einsum("nik,ni->nk", motions, normal)
    weighed = cho_solve(cho_factor(noise, lower=True), A)
    precision = np.eye(A.shape[1]) + A.T @ weighed
    mean = np.linalg.solve(precision, weighed.T @ shift)
    return WallMotion(
        X, at_rest, kernel, whole, basis, sections, slides, mean, np.linalg.inv(np.linalg.cholesky(precision)).T
    )


def _trusted(noise: FloatArray, off: FloatArray, cauchy: float) -> FloatArray:
    """Noise (q, q) mm2, larger at points that are off (q,) mm the likeliest motion by more than it, as a Cauchy density's weights have it.

    Where a wall leaves the scan its two surfaces may end differently, by centimetres.
    """
    usual = max(1.4826 * float(np.median(np.abs(off))), float(np.sqrt(np.diag(noise).mean())))
    wider = np.sqrt(1.0 + (off / (cauchy * usual)) ** 2)
    return np.asarray(noise * np.outer(wider, wider))


def _basis(X: FloatArray, length: float) -> FloatArray:
    """(q, m) that takes kernel values (n, q) to the kernel's modes (n, m)."""
    modes = noise_modes(X, 1.0, length, _SHARE)
    return modes / np.maximum((modes**2).sum(axis=0), 1e-30)


def _smoothed(near: FloatArray, v: FloatArray, normal: FloatArray, shift: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normals (q, 3) averaged with weights near (q, q), and shifts (q,) that ask for the same distance along them from v (q, 3)."""
    away = (normal * v).sum(axis=1) - shift
    mean = near @ normal
    mean /= np.maximum(np.linalg.norm(mean, axis=1), 1e-9)[:, None]
    return mean, (mean * v).sum(axis=1) - away


def _normals(at_rest: DistanceFunction, x: FloatArray) -> FloatArray:
    gradient = at_rest(x)[1]
    return np.asarray(gradient / np.maximum(np.linalg.norm(gradient, axis=1), 1e-9)[:, None])
