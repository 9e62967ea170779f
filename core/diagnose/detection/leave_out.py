"""Splits of a case's data: patches of the organ's surface and the landmarks, and patches of the bones, left out in
turn."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.inference.heldout import Split
from palpate.core.observe.contour_noise import smooth_covariance
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.joint_states import apart
from palpate.core.residual.plain_fit import PlainFit


def organ_split(fit: PlainFit, rules: DecisionRules) -> Split:
    """Patches of the organ, then one of all landmarks; the bones' motion is never left out.

    A patch is left out of all deformed states at once, because they share the contour at rest. Rows of the organ's
    surfaces come first, state by state.
    """
    data_vectors, at_rest = fit.model.data_vectors, fit.linearisation.first.scene.observation.points
    chosen = _thinned(at_rest, rules.point_spacing_mm)
    surface = apart([_rows_of_surface(data, chosen) for data in data_vectors])
    rest = np.delete(np.eye(fit.model.n), fit.model.surface, axis=0)
    reader = np.vstack([surface, rest])
    points = np.tile(at_rest[chosen], (len(data_vectors), 1))
    patch = np.full(len(reader), -1)
    patch[: len(points)] = np.tile(_patches(at_rest[chosen], rules.patch_mm), len(data_vectors))
    marks = np.concatenate([np.arange(s.n - s.n_modes) < 3 * s.n_marks for s in data_vectors])
    if marks.any():
        patch[len(points) + np.flatnonzero(marks)] = patch.max() + 1
    covariance = reader @ fit.weighting.covariance @ reader.T
    covariance[np.arange(len(points)), np.arange(len(points))] += fit.options.patch_nugget_mm**2
    return Split(reader, np.zeros(len(reader)), patch, covariance, points)


def _rows_of_surface(data: DataVector, chosen: IntArray) -> FloatArray:
    """Matrix (c, n) that takes a state's data to the organ's surface at the chosen points (c,)."""
    out = np.zeros((len(chosen), data.n))
    out[:, : data.n_modes] = data.modes[chosen]
    return out


def bone_split(fit: PlainFit, state: int, rules: DecisionRules) -> Split | None:
    """Patches of a state's bones, left out in turn, and all other data, which are not; None where the state shows no
    bones."""
    organ, bone, at = organ_split(fit, rules), fit.model.each[state].data.bone, fit.model.bones[state]
    if bone is None or at is None:
        return None
    chosen = _thinned(bone.points, rules.bone_point_spacing_mm)
    points = bone.points[chosen]
    reader = np.zeros((len(chosen), fit.model.n))
    reader[:, at] = bone.design[chosen]
    sd, length = fit.sizes.contour * fit.linearisation.first.scene.problem.facts.noise_sd_mm, fit.sizes.length
    smooth = (1.0 - fit.sizes.long) * smooth_covariance(points, sd, length)
    smooth += fit.sizes.long * smooth_covariance(points, sd, fit.options.long_mm)
    noise = 2.0 * smooth + bone.design[chosen] @ bone.floor @ bone.design[chosen].T
    noise[np.diag_indices_from(noise)] += fit.options.bone_extraction_mm**2
    kept = ~organ.reader[:, at].any(axis=1)
    m = len(chosen) + int(kept.sum())
    covariance = np.zeros((m, m))
    covariance[: len(chosen), : len(chosen)] = noise
    covariance[len(chosen) :, len(chosen) :] = organ.covariance[np.ix_(kept, kept)]
    patch = np.full(m, -1)
    patch[: len(chosen)] = _patches(points, rules.bone_patch_mm)
    constant = np.concatenate([bone.misfit[chosen], np.zeros(int(kept.sum()))])
    return Split(np.vstack([reader, organ.reader[kept]]), constant, patch, covariance, points)


def _thinned(points: FloatArray, spacing: float) -> IntArray:
    cube = np.floor(points / spacing).astype(np.int64)
    _, first = np.unique(cube, axis=0, return_index=True)
    return np.sort(first)


def _patches(points: FloatArray, width: float) -> IntArray:
    """Patch index of each point: Voronoi cells of seeds, each the point farthest from those before."""
    seeds = [int(np.argmin(points[:, 2]))]
    distance = np.linalg.norm(points - points[seeds[0]], axis=1)
    while distance.max() > width:
        seeds.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[seeds[-1]], axis=1))
    return np.argmin(np.linalg.norm(points[:, None] - points[seeds], axis=2), axis=1)
