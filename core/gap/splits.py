"""How a case's data are left out in turn: the organ's surface in patches and the landmarks, and the bones' surfaces in patches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from palpate.core.gap.heldout import Split
from palpate.core.gap.plain import PlainFit
from palpate.core.observe.noise import EXTRACTION_MM, smooth_covariance

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Width of a patch of the organ, mm: two correlation lengths of the contour noise. Bones are larger.
PATCH_MM, BONE_PATCH_MM = 14.0, 28.0
# Points are thinned to about this spacing, mm, and take an independent error of this size, mm.
_SPACING_MM, _BONE_SPACING_MM = 4.0, 9.0
_NUGGET_MM = 0.1


def organ_split(fit: PlainFit) -> Split:
    """Patches of the organ, then one of all landmarks; the bones' motion is never left out."""
    sight, scene = fit.bench.sight, fit.point.scene
    chosen = _thinned(scene.observation.points, _SPACING_MM)
    points = scene.observation.points[chosen]
    k, n = sight.n_modes, sight.n
    reader = np.zeros((len(chosen) + n - k, n))
    reader[: len(chosen), :k] = sight.modes[chosen]
    reader[len(chosen) :, k:] = np.eye(n - k)
    patch = np.full(len(reader), -1)
    patch[: len(chosen)] = _patches(points, PATCH_MM)
    if sight.n_marks:
        patch[len(chosen) : len(chosen) + 3 * sight.n_marks] = patch.max() + 1
    covariance = reader @ fit.weighting.covariance @ reader.T
    covariance[np.arange(len(chosen)), np.arange(len(chosen))] += _NUGGET_MM**2
    return Split(reader, np.zeros(len(reader)), patch, covariance, points)


def bone_split(fit: PlainFit) -> Split | None:
    """Patches of the bones' surfaces, whose rigid motion the others must tell, and the organ, which is not left out."""
    organ, bone = organ_split(fit), fit.bench.sight.bone
    if bone is None:
        return None
    chosen = _thinned(bone.points, _BONE_SPACING_MM)
    points, n = bone.points[chosen], fit.bench.sight.n
    reader = np.zeros((len(chosen), n))
    reader[:, -6:] = bone.design[chosen]
    sd, length = fit.sizes.contour * fit.point.scene.problem.facts.noise_sd_mm, fit.sizes.length
    noise = 2.0 * smooth_covariance(points, sd, length) + bone.design[chosen] @ bone.floor @ bone.design[chosen].T
    noise[np.diag_indices_from(noise)] += EXTRACTION_MM**2
    seen = len(organ.reader) - 6
    m = len(chosen) + seen
    covariance = np.zeros((m, m))
    covariance[: len(chosen), : len(chosen)] = noise
    covariance[len(chosen) :, len(chosen) :] = organ.covariance[:seen, :seen]
    patch = np.full(m, -1)
    patch[: len(chosen)] = _patches(points, BONE_PATCH_MM)
    constant = np.concatenate([bone.misfit[chosen], np.zeros(seen)])
    return Split(np.vstack([reader, organ.reader[:seen]]), constant, patch, covariance, points)


def _thinned(points: FloatArray, spacing: float) -> IntArray:
    cube = np.floor(points / spacing).astype(np.int64)
    _, first = np.unique(cube, axis=0, return_index=True)
    return np.sort(first)


def _patches(points: FloatArray, width: float) -> IntArray:
    """Voronoi cells of points far apart: every next seed is the point farthest from those before."""
    seeds = [int(np.argmin(points[:, 2]))]
    distance = np.linalg.norm(points - points[seeds[0]], axis=1)
    while distance.max() > width:
        seeds.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[seeds[-1]], axis=1))
    return np.argmin(np.linalg.norm(points[:, None] - points[seeds], axis=2), axis=1)
