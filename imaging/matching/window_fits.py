"""Least-squares shift of every window between two scans, with its brightness and contrast (Lucas and Kanade 1981)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import Float32Array, FloatArray
from palpate.imaging.matching.noise import noise_shares
from palpate.imaging.matching.scan_pair import ScanPair
from palpate.imaging.matching.window_sums import pairs, symmetric

# The most that a window moves in one step, over its standard deviation; and what is added to A, HU2/mm2, so that a
# direction without texture stays where it is.
STEP, DAMPING = 0.3, 1.4
# Standard deviation below which a scan shows nothing that its contrast could be told from, HU.
LEAST_SPREAD_HU = 1.0


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Of every window (...): A (..., 3, 3) HU2/mm2, right-hand side (..., 3), and the fields that they are sums of.

    mixed : (..., 2, 3) 1/mm, share of brightness and of contrast in each gradient, which is taken out of A and the
    right-hand side. gradient : three of (ni, nj, nk) HU/mm, of the mean of both scans, the noisier one counting for less
    (`noise_shares`). nuisance : brightness and contrast, two of (ni, nj, nk); contrast is that of this mean as well, for the noise
    of one scan is part of the difference, and would pass for a contrast that is not there; that of the mean goes with no
    difference. difference, weight : (ni, nj, nk); the second scan has the first's brightness and contrast on the whole.
    noise_of_mean : variance of the mean's noise over that of the difference's.
    """

    A: FloatArray
    right: FloatArray
    mixed: FloatArray
    gradient: list[Float32Array]
    nuisance: list[Float32Array]
    difference: Float32Array
    weight: Float32Array
    noise_of_mean: float


def shifts(pair: ScanPair, motion: FloatArray, iterations: int) -> tuple[FloatArray, NormalEquations]:
    """Every window's shift (..., 3) mm beyond a motion (..., 3) mm of the nodes, and the equations at the end."""
    shift = np.zeros_like(motion)
    for _ in range(iterations):
        at = normal_equations(pair, motion, shift)
        damped = at.A + DAMPING * np.eye(3)
        step = np.linalg.solve(damped, (at.right + DAMPING * shift)[..., None])[..., 0] - shift
        length = np.linalg.norm(step, axis=-1, keepdims=True)
        shift = shift + step * np.minimum(1.0, STEP * pair.windows.sigma_mm / np.maximum(length, 1e-9))
    return shift, normal_equations(pair, motion, shift)


def normal_equations(pair: ScanPair, motion: FloatArray, shift: FloatArray) -> NormalEquations:
    """The equations of every window's one shift, brightness and contrast taken out.

    The second scan is seen under a shift that differs from place to place. Were it p in the whole window, the scan would
    be moved + g . (p - shift): the window's p is the one for which that is nearest to the first scan.
    """
    return equations_under(pair, *pair.moved(motion + shift), shift)


def equations_under(
    pair: ScanPair, moved: Float32Array, weight: Float32Array, shift: FloatArray | None = None
) -> NormalEquations:
    """The equations for the second scan as it lies under a motion, moved (ni, nj, nk) HU, with the weight of every voxel.

    shift (..., 3) mm : the part of the motion that the windows' shifts are counted without; None counts them from the
    whole motion.
    """
    moved = _alike(moved, pair.first, weight)
    ours, theirs = noise_shares(pair.first, moved, weight)
    mean = np.asarray(theirs * pair.first + ours * moved, dtype=np.float32)
    g = [np.gradient(mean, pair.grid.spacing[a], axis=a).astype(np.float32) for a in range(3)]
    level = np.float32((mean * weight).sum() / max(float(weight.sum()), 1.0))
    fields = [*g, np.ones_like(mean), mean - level]
    difference = pair.first - moved
    target = difference
    if shift is not None:
        target = target + sum(g[a] * pair.windows.spread(shift[..., a]) for a in range(3))
    weighted = [weight * f for f in fields]
    sums = {(i, j): pair.windows.sum(weighted[i] * fields[j]) for i, j in pairs(5)}
    right = np.stack([pair.windows.sum(f * target) for f in weighted], axis=-1)
    full = symmetric(sums, 5)
    nuisance = full[..., 3:, 3:] + 1e-3 * np.eye(2)
    mixed = np.linalg.solve(nuisance, np.swapaxes(full[..., :3, 3:], -1, -2))
    A = full[..., :3, :3] - full[..., :3, 3:] @ mixed
    score = right[..., :3] - (full[..., :3, 3:] @ np.linalg.solve(nuisance, right[..., 3:, None]))[..., 0]
    return NormalEquations(
        A, np.asarray(score, dtype=np.float64), np.asarray(mixed, dtype=np.float64), g, fields[3:], difference, weight,
        ours * theirs,
    )  # fmt: skip


def _alike(moved: Float32Array, first: Float32Array, weight: Float32Array) -> Float32Array:
    """The second scan, moved (ni, nj, nk) HU, with the mean and the standard deviation of the first where weights are."""
    total = max(float(weight.sum()), 1.0)
    ours, theirs = (float((weight * scan).sum(dtype=np.float64)) / total for scan in (first, moved))
    spread, other = (
        float(np.sqrt((weight * (scan - mean) ** 2).sum(dtype=np.float64) / total))
        for scan, mean in ((first, ours), (moved, theirs))
    )
    gain = spread / other if min(spread, other) > LEAST_SPREAD_HU else 1.0
    return np.asarray(ours + gain * (moved - theirs), dtype=np.float32)


def smooth_field(pair: ScanPair, shift: FloatArray, A: FloatArray) -> FloatArray:
    """The shifts (..., 3) averaged over neighbouring windows, each direction weighed by what its window knows of it.

    Motion that varies within a window is in this field then, and what a window finds beyond it is nearer a constant.
    """
    mean = pair.windows.mean_of_neighbours
    weighted = (A @ shift[..., None])[..., 0]
    mean_A = np.stack([mean(A[..., i, j]) for i in range(3) for j in range(3)], axis=-1).reshape(A.shape)
    right = np.stack([mean(weighted[..., i]) for i in range(3)], axis=-1)
    floor = 1e-3 * np.trace(mean_A, axis1=-2, axis2=-1)[..., None, None] + 1e-6
    return np.asarray(np.linalg.solve(mean_A + floor * np.eye(3), right[..., None])[..., 0])
