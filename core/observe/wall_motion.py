"""Prior for the motion of a hollow organ's wall, and its posterior given two scans; CT shows only the normal component.

What fills or leaves a hollow organ presses along its wall's normal. The motion is a Gaussian process in space,
v = a n + t + g + w:

- a n : a scalar process a along the normal n of the wall at rest;
- t : a translation, of a bag as one, of a tube section by section;
- g : growth of a bag to another size of the same shape;
- w : a small motion of any direction.

Independent pressures on a wall add up to a force with covariance mean(n n'). Along each axis t and w have the variance
that this covariance has, so that a tube hardly moves along its own axis, where nothing pushes it and no scan would show
it. a and w share one squared-exponential kernel, whose length and size maximise the marginal likelihood of the normal
motion (type-II maximum likelihood; Rasmussen & Williams 2006, 5.4). The sizes of t and g are options, see
`WallRigidModes`. A wall may move with what pushes it, or give way to the tissue without friction, or anything between:
`WallSlip` is the way from the one to the other. Large parts of a wall may also slide along themselves, driven by what
no scan shows; that has mean 0 and is counted as noise (`slide_mm`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.core.fem.terms.springs import Springs
from palpate.core.fem.terms.wall import DistanceFunction, SlidingWall
from palpate.core.observe.contour_errors import ContourErrors
from palpate.core.observe.contour_noise import noise_modes
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.observe.wall_motion_prior import Kernel, likeliest
from palpate.core.observe.wall_rigid_and_growth import WallRigidModes
from palpate.core.observe.wall_slip import WallSlip

# Resolution: points of a wall that its motion is learnt from, and the kernel's sizes alone, at most; share of the
# kernel's variance that is kept.
POINTS, _FEWER, _SHARE = 400, 200, 0.98


@dataclass(frozen=True, eq=False)
class WallMotion:
    """Posterior of a wall's motion.

    points (q, 3) mm : where the motion was learnt. at_rest : signed distance of the wall at rest, whose gradient is its
    normal. kernel : of a and w. rigid : t and g, and the axes of w. basis (q, m), sections (q, s), slides (q, w) : take
    kernel values at `points` to the modes of a and w, of a tube's sections, and of slides of large parts.
    slip : half of what a wall without friction slides farther than the likeliest motion, None where unknown.
    mean (a,), factor (a, r) : posterior mean of a = 4 m + 3 s + 1 amplitudes (modes along the normal and the axes,
    translations, growth), and a factor of their posterior covariance.
    """

    points: FloatArray
    at_rest: DistanceFunction
    kernel: Kernel
    rigid: WallRigidModes
    basis: FloatArray
    sections: FloatArray
    slides: FloatArray
    mean: FloatArray
    factor: FloatArray
    slip: WallSlip | None = None

    @classmethod
    def of(
        cls, wall: SlidingWall, at_rest: DistanceFunction, noise: float | ContourErrors, options: WallMotionOptions
    ) -> WallMotion:
        """Posterior for a wall that lies, at rest, where the first scan shows it.

        noise : standard deviation of one contour, mm, or the errors of both scans' contours at `wall.rest`.
        """
        chosen = np.random.default_rng(0).permutation(len(wall.rest))[:POINTS]
        X = wall.rest[chosen]
        out = _normals(at_rest, X)
        errors = noise if isinstance(noise, ContourErrors) else ContourErrors.even(wall.rest, noise)
        errors = errors.part(chosen)
        noise_of_both = errors.covariance(errors, options.noise_length_mm, same_state=True)
        noise_of_both += options.voxels_mm**2 * np.eye(len(X))
        rigid = WallRigidModes.of(wall.rest, _normals(at_rest, wall.rest), options)
        few = slice(None, None, -(-len(X) // _FEWER))
        near = np.exp(-0.5 * (cdist(X, X) / options.smooth_mm) ** 2)
        v, off = np.zeros_like(wall.rest), np.zeros(len(X))
        for k in range(options.rounds):
            linear_wall = wall.linearised_at(v)
            normal, shift = linear_wall.normal[chosen], linear_wall.shift[chosen]
            if k > 0:  # at first points may lie far from the deformed wall, and neighbours see different parts of it
                normal, shift = _smoothed(near, v[chosen], normal, shift)
            trusted = _trusted(noise_of_both, off, options.cauchy)
            kernel = likeliest(X[few], out[few], normal[few], shift[few], trusted[few, few], rigid)
            posterior = _posterior(X, at_rest, normal, shift, trusted, kernel, rigid)
            v = posterior.at(wall.rest)
            off = shift - (normal * v[chosen]).sum(axis=1)
        return posterior

    def at(self, x: FloatArray) -> FloatArray:
        """Posterior mean of the motion (n, 3) mm at x (n, 3) mm."""
        return np.asarray(self._motions(x) @ self.mean)

    @property
    def options(self) -> WallMotionOptions:
        """Numbers of the prior and of the contours' noise."""
        return self.rigid.options

    @property
    def slide_mm(self) -> float:
        """Standard deviation per axis of a slide of large parts, mm: a share of the rms motion."""
        return self.options.slide_share * float(np.sqrt((self.at(self.points) ** 2).sum(axis=1).mean()))

    def unknown_at(self, x: FloatArray) -> FloatArray:
        """Motions (r, n, 3) mm at x (n, 3) mm whose sum with independent unit normal amplitudes has the posterior
        covariance, slides included."""
        parts = np.exp(-0.5 * (cdist(x, self.points) / self.options.slide_length_mm) ** 2) @ self.slides
        slides = np.einsum("nm,ik->mkni", self.slide_mm * parts, np.eye(3)).reshape(-1, len(x), 3)
        half = np.zeros((0, len(x), 3)) if self.slip is None else self.slip.at(x)[None]
        return np.concatenate([np.moveaxis(self._motions(x) @ self.factor, 2, 0), slides, half])

    def likeliest_at(self, x: FloatArray) -> FloatArray:
        """Where a wall is drawn to: the posterior mean (n, 3) mm at x (n, 3) mm and as much of the slip as is likely."""
        return self.at(x) if self.slip is None else self.at(x) + self.slip.factor * self.slip.at(x)

    def _motions(self, x: FloatArray) -> FloatArray:
        """Motions (n, 3, a) mm at x (n, 3) mm for unit amplitudes."""
        modes = np.exp(-0.5 * (cdist(x, self.points) / self.kernel.length) ** 2) @ self.basis
        along = self.kernel.size * _normals(self.at_rest, x)[:, :, None]
        axes = np.tile(self.rigid.axes, (len(x), 1, 1))
        ways = np.concatenate([along, self.options.sideways_mm * axes], axis=2)
        smooth = np.einsum("nik,nm->nikm", ways, modes).reshape(len(x), 3, -1)
        grown = self.rigid.growth(x)[:, :, None]
        shifts = self.rigid.correlation(x, self.points) @ self.sections
        moved = np.einsum("nik,ns->niks", self.rigid.translation_mm * axes, shifts).reshape(len(x), 3, -1)
        return np.concatenate([smooth, moved, grown], axis=2)

    def drag(self, wall: SlidingWall, shift: FloatArray, u: FloatArray, way: float, shear_kpa: float) -> Springs:
        """Springs along a wall's surface that hold it where the posterior mean puts it.

        shift : (q, 3) mm from the scanned to the stress-free rest position of its points. u : nodal displacements (n,
        3) the wall is linearised at. way : share of the remaining distance to ask for. shear_kpa : shear modulus of the
        tissue.
        """
        now = wall.points.displacements(u)
        target = now + way * (self.likeliest_at(wall.rest - shift) - shift - now)
        along = np.eye(3) - wall.normal[:, :, None] * wall.normal[:, None, :]
        return Springs(wall.points, self.options.drag_per_mm * shear_kpa * along, target)


def _posterior(
    X: FloatArray,
    at_rest: DistanceFunction,
    normal: FloatArray,
    shift: FloatArray,
    noise: FloatArray,
    kernel: Kernel,
    rigid: WallRigidModes,
) -> WallMotion:
    basis, slides = (_basis(X, length) for length in (kernel.length, rigid.options.slide_length_mm))
    sections = _basis(np.outer(X @ rigid.along, rigid.along), rigid.options.section_length_mm)
    nothing = np.zeros(0)
    motions = WallMotion(X, at_rest, kernel, rigid, basis, sections, slides, nothing, nothing)._motions(X)
    A = np.einsum("nik,ni->nk", motions, normal)
    weighed = cho_solve(cho_factor(noise, lower=True), A)
    precision = np.eye(A.shape[1]) + A.T @ weighed
    mean = np.linalg.solve(precision, weighed.T @ shift)
    return WallMotion(
        X, at_rest, kernel, rigid, basis, sections, slides, mean, np.linalg.inv(np.linalg.cholesky(precision)).T
    )


def _trusted(noise: FloatArray, off: FloatArray, cauchy: float) -> FloatArray:
    """Noise covariance (q, q) mm2, inflated at outliers by Cauchy's weights (Holland & Welsch 1977).

    off (q,) mm : misfit of the present motion. Outliers occur where a wall leaves the scan: its two surfaces may end
    centimetres apart.
    """
    usual = max(1.4826 * float(np.median(np.abs(off))), float(np.sqrt(np.diag(noise).mean())))
    wider = np.sqrt(1.0 + (off / (cauchy * usual)) ** 2)
    return np.asarray(noise * np.outer(wider, wider))


def _basis(X: FloatArray, length: float) -> FloatArray:
    """Matrix (q, m) that takes kernel values (n, q) to the kernel's modes (n, m)."""
    modes = noise_modes(X, 1.0, length, _SHARE)
    return modes / np.maximum((modes**2).sum(axis=0), 1e-30)


def _smoothed(near: FloatArray, v: FloatArray, normal: FloatArray, shift: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normals (q, 3) averaged with weights near (q, q), and shifts (q,) mm with the same distances left along them from
    v (q, 3) mm."""
    away = (normal * v).sum(axis=1) - shift
    mean = near @ normal
    mean /= np.maximum(np.linalg.norm(mean, axis=1), 1e-9)[:, None]
    return mean, (mean * v).sum(axis=1) - away


def _normals(at_rest: DistanceFunction, x: FloatArray) -> FloatArray:
    gradient = at_rest(x)[1]
    return np.asarray(gradient / np.maximum(np.linalg.norm(gradient, axis=1), 1e-9)[:, None])
