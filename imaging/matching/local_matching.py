"""Local matching of two scans: a displacement and its precision at each control point.

Every point has a Gaussian window in which the motion is the predicted one and a small constant shift. Shift, brightness
and contrast of the window minimise the squared difference of the two scans (Lucas and Kanade 1981; in mechanics:
digital volume correlation). What is left of the difference is the noise; its size in the window and the correlation of
its neighbours give the covariance of the shift: A^-1 M A^-1, A the window's sum of g g^T, M the covariance of the
score. A counts the gradient g of the picture alone: what noise adds to it is taken off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, Float32Array, FloatArray
from palpate.imaging.matching.noise import CorrelatedNoise, measured_correlation
from palpate.imaging.matching.window_sums import Windows, pairs, symmetric
from palpate.imaging.volume import Volume

# Standard deviations by which a window's texture must exceed what noise leaves by chance.
CHANCE = 3.0

Motion = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, kw_only=True)
class MatchOptions:
    """window_mm : standard deviation of the Gaussian windows. spacing_mm : of the control points.

    smoothing_mm : standard deviation of the filter that both scans go through first. iterations : Gauss-Newton steps.
    step_mm : the most that a point moves in one of them. full : the least share of a window that must be usable.
    rounds : how often the windows' shifts become part of the motion that they are sought about.
    damping : added to A, HU2/mm2, so that a direction without texture stays where it is.
    """

    window_mm: float = 5.0
    spacing_mm: float = 6.0
    smoothing_mm: float = 0.9
    iterations: int = 4
    step_mm: float = 1.5
    full: float = 0.3
    damping: float = 1.4
    rounds: int = 1


@dataclass(frozen=True, eq=False)
class MatchedMotion:
    """points : (n, 3) mm in the first scan, each where its window's texture lies. displacement : (n, 3) mm to where they lie in the second.

    precision : (n, 3, 3) 1/mm2 of each displacement; a direction without texture has none. shift : (n, 3) mm from the
    predicted to the matched motion. left_hu : (n,) standard deviation of the difference that is left in the window.
    correlation_mm : distance over which errors of neighbouring points go along, as exp(-(d / correlation_mm)^2).
    """

    points: FloatArray
    displacement: FloatArray
    precision: FloatArray
    shift: FloatArray
    left_hu: FloatArray
    correlation_mm: float


@dataclass(frozen=True, eq=False)
class _Pair:
    """Both scans on the first one's grid: first, and the second as it lies under the current motion."""

    first: Float32Array
    second: Volume
    usable: BoolArray
    other_usable: Volume
    places: FloatArray
    windows: Windows
    grid: Volume

    def to_index(self, points: FloatArray) -> FloatArray:
        """Fractional indices (n, 3) of points (n, 3) mm."""
        return self.grid.to_index(points)


def match(
    first: Volume,
    second: Volume,
    usable: tuple[BoolArray, BoolArray],
    predicted: Motion,
    options: MatchOptions | None = None,
) -> MatchedMotion:
    """The motion from the first scan to the second.

    first, second : HU, axes of the first along LPS. usable : masks on the grids of both of what has a counterpart in
    the other (no urine, gas, stool, bone, nothing outside the body). predicted : displacement (n, 3) mm at points
    (n, 3) mm, from which matching starts.
    """
    options = options or MatchOptions()
    pair = _prepared(first, second, usable, options)
    start = predicted(pair.places.reshape(-1, 3)).reshape(pair.places.shape)
    motion = start
    for _ in range(options.rounds):
        shift, A = _shifts(pair, motion, options)
        motion = motion + _smooth_field(pair.windows, shift, A)
    shift, _ = _shifts(pair, motion, options)
    return _at_points(pair, start, motion, shift, options)


def _shifts(pair: _Pair, motion: FloatArray, options: MatchOptions) -> tuple[FloatArray, FloatArray]:
    """Every window's shift (..., 3) mm beyond a motion, and its A (..., 3, 3)."""
    shift = np.zeros_like(motion)
    for _ in range(options.iterations):
        moved, weight = _moved(pair, motion + shift)
        A, right, _ = _normal_equations(pair, moved, weight, shift)
        damped = A + options.damping * np.eye(3)
        step = np.linalg.solve(damped, (right + options.damping * shift)[..., None])[..., 0] - shift
        length = np.linalg.norm(step, axis=-1, keepdims=True)
        shift = shift + step * np.minimum(1.0, options.step_mm / np.maximum(length, 1e-9))
    return shift, A


def _smooth_field(windows: Windows, shift: FloatArray, A: FloatArray) -> FloatArray:
    """The shifts averaged over windows, each direction weighed by what its window knows of it.

    Motion that varies within a window is in this field then, and what a window finds beyond it is nearer a constant.
    """
    weighted = (A @ shift[..., None])[..., 0]
    mean_A = symmetric({(i, j): windows.sum(A[..., i, j].astype(np.float32)) for i, j in pairs(3)}, 3)
    mean = np.stack([windows.sum(weighted[..., i].astype(np.float32)) for i in range(3)], axis=-1)
    floor = 1e-3 * np.trace(mean_A, axis1=-2, axis2=-1)[..., None, None] + 1e-6
    return np.asarray(np.linalg.solve(mean_A + floor * np.eye(3), mean[..., None])[..., 0])


def _prepared(first: Volume, second: Volume, usable: tuple[BoolArray, BoolArray], options: MatchOptions) -> _Pair:
    index = np.moveaxis(np.indices(first.array.shape), 0, -1).reshape(-1, 3).astype(float)
    places = first.to_lps(index).reshape(*first.array.shape, 3)
    smooth = _smoothed(first, options.smoothing_mm)
    other = second.with_array(_smoothed(second, options.smoothing_mm))
    return _Pair(
        smooth, other, usable[0], second.with_array(usable[1].astype(np.float32)), places,
        Windows(options.window_mm, first.spacing), first,
    )  # fmt: skip


def _smoothed(volume: Volume, sigma_mm: float) -> Float32Array:
    return np.asarray(ndimage.gaussian_filter(volume.array.astype(np.float32), sigma_mm / volume.spacing))


def _moved(pair: _Pair, motion: FloatArray) -> tuple[Float32Array, Float32Array]:
    """The second scan as it lies under the motion, and which voxels count in both."""
    at = pair.second.to_index((pair.places + motion).reshape(-1, 3)).T
    values = ndimage.map_coordinates(pair.second.array, at, order=3, mode="nearest").reshape(pair.first.shape)
    seen = ndimage.map_coordinates(pair.other_usable.array, at, order=1, mode="constant").reshape(pair.first.shape)
    return values.astype(np.float32), (pair.usable & (seen > 0.95)).astype(np.float32)


def _gradient(pair: _Pair, moved: Float32Array) -> list[Float32Array]:
    """Gradient, HU/mm, of the mean of both scans: half the noise of one."""
    mean = 0.5 * (pair.first + moved)
    return [np.gradient(mean, pair.windows.spacing[a], axis=a).astype(np.float32) for a in range(3)]


def _normal_equations(
    pair: _Pair, moved: Float32Array, weight: Float32Array, shift: FloatArray
) -> tuple[FloatArray, FloatArray, list[Float32Array]]:
    """A (..., 3, 3) and right-hand side (..., 3) of a window's one shift, brightness and contrast taken out.

    `moved` is the second scan under a shift (..., 3) mm that differs from place to place. Were it p in the whole window,
    the scan would be moved + g . (p - shift): the window's p is the one for which that is nearest to the first scan.
    """
    g = _gradient(pair, moved)
    fields = [*g, np.ones_like(moved), moved - np.float32(moved.mean())]
    difference = pair.first - moved + sum(g[a] * shift[..., a].astype(np.float32) for a in range(3))
    S = {(i, j): pair.windows.sum(weight * fields[i] * fields[j]) for i, j in pairs(5)}
    r = np.stack([pair.windows.sum(weight * f * difference) for f in fields], axis=-1)
    full = symmetric(S, 5)
    nuisance = full[..., 3:, 3:] + 1e-3 * np.eye(2)
    mixed = np.linalg.solve(nuisance, np.swapaxes(full[..., :3, 3:], -1, -2))
    A = full[..., :3, :3] - full[..., :3, 3:] @ mixed
    score = r[..., :3] - (full[..., :3, 3:] @ np.linalg.solve(nuisance, r[..., 3:, None]))[..., 0]
    return A, np.asarray(score, dtype=np.float64), g


def _at_points(
    pair: _Pair, start: FloatArray, motion: FloatArray, shift: FloatArray, options: MatchOptions
) -> MatchedMotion:
    moved, weight = _moved(pair, motion + shift)
    A, _, g = _normal_equations(pair, moved, weight, shift)
    difference = pair.first - moved
    share = np.maximum(pair.windows.sum(weight), 1e-6)
    mean = pair.windows.sum(weight * difference) / share
    variance = np.maximum(pair.windows.sum(weight * difference**2) / share - mean**2, 1e-6)
    noise = measured_correlation(difference, weight > 0.5)
    A = _without_noise(A, pair, weight, variance, noise)
    M = _score_covariance(pair, weight, g, variance, noise)
    keep = _control_points(pair, share, weight, options)
    beyond = (_smooth_field(pair.windows, shift, A) - shift)[keep]
    precision = _less_sure(_precision(A[keep], M[keep]), beyond)
    centre = _centre_of_texture(pair, weight, g, keep)
    at = pair.to_index(centre)
    begin = _interpolated(start, at)
    found = _interpolated(motion, at) + shift[keep]
    return MatchedMotion(
        centre, found, precision, found - begin, np.sqrt(variance[keep]),
        2.0 * options.window_mm,
    )  # fmt: skip


def _without_noise(
    A: FloatArray, pair: _Pair, weight: Float32Array, variance: FloatArray, noise: CorrelatedNoise
) -> FloatArray:
    """A less what the noise's own gradient adds to it: a quarter of the difference's, as the mean of both scans has.

    That part scatters from window to window. CHANCE standard deviations of its scatter are taken off as well, so that
    noise alone does not pass for texture.
    """
    scatter = np.sqrt(2.0 * noise.together / pair.windows.independent_voxels)
    share = (1.0 + CHANCE * scatter) * pair.windows.sum(weight)
    found = A.copy()
    for axis in range(3):
        kernel = noise.kernels[axis]
        two = kernel[len(kernel) // 2 + 2] if len(kernel) > 4 else 0.0
        found[..., axis, axis] -= share * 0.25 * variance * (1.0 - two) / (2.0 * pair.windows.spacing[axis] ** 2)
    return found


def _score_covariance(
    pair: _Pair, weight: Float32Array, g: list[Float32Array], variance: FloatArray, noise: CorrelatedNoise
) -> FloatArray:
    weighted = [weight * f for f in g]
    spread = [noise.applied(f) for f in weighted]
    parts = {
        (i, j): 0.5 * pair.windows.sum_of_squared_weights(weighted[i] * spread[j] + weighted[j] * spread[i])
        for i, j in pairs(3)
    }
    return symmetric(parts, 3) * variance[..., None, None]


def _precision(A: FloatArray, M: FloatArray) -> FloatArray:
    """A M^-1 A (n, 3, 3), with what A has lost to noise counted as nothing."""
    value, vector = np.linalg.eigh(A)
    A = np.einsum("nij,nj,nkj->nik", vector, np.maximum(value, 0.0), vector)
    floor = 1e-9 * np.maximum(np.trace(M, axis1=1, axis2=2), 1e-12)
    return A @ np.linalg.solve(M + floor[:, None, None] * np.eye(3), A)


def _centre_of_texture(pair: _Pair, weight: Float32Array, g: list[Float32Array], keep: BoolArray) -> FloatArray:
    """Where in its window (n, 3) mm the texture lies that a shift was found by: there it holds."""
    texture = weight * sum(f * f for f in g)
    total = np.maximum(pair.windows.sum(texture)[keep], 1e-9)
    away = pair.places - pair.places.reshape(-1, 3).mean(axis=0)
    mean = [pair.windows.sum((texture * away[..., a]).astype(np.float32))[keep] / total for a in range(3)]
    return np.stack(mean, axis=-1) + pair.places.reshape(-1, 3).mean(axis=0)


def _interpolated(field: FloatArray, index: FloatArray) -> FloatArray:
    """A field (ni, nj, nk, 3) at fractional indices (n, 3)."""
    return np.stack(
        [ndimage.map_coordinates(field[..., a], index.T, order=1, mode="nearest") for a in range(3)], axis=-1
    )


def _less_sure(precision: FloatArray, bias: FloatArray) -> FloatArray:
    """Precision (n, 3, 3) when an error (n, 3) mm of unknown sign is added: motion that is not constant in the window."""
    along = (precision @ bias[..., None])[..., 0]
    share = 1.0 + np.einsum("ni,ni->n", bias, along)
    return precision - along[:, :, None] * along[:, None, :] / share[:, None, None]


def _control_points(pair: _Pair, share: FloatArray, weight: Float32Array, options: MatchOptions) -> BoolArray:
    """Voxels on a coarse lattice that are usable and whose windows are full enough."""
    lattice = np.zeros(pair.first.shape, dtype=bool)
    every = np.maximum(np.rint(options.spacing_mm / pair.windows.spacing).astype(int), 1)
    lattice[tuple(slice(int(e) // 2, None, int(e)) for e in every)] = True
    return lattice & (weight > 0.5) & (share > options.full)
