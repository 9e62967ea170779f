"""Split of a case's data into blocks that are left out in turn: the organ's surface and the motion that the images show around it,
and the landmarks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.fem.space import locate
from palpate.core.inference.heldout import Split
from palpate.core.observe.motion_rows import MOTION_LENGTH_MM, motion_in_mm
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.residual.plain_fit import PlainFit

SURFACE, INSIDE, TISSUE = _PARTS = ("surface", "inside", "tissue")


@dataclass(frozen=True, eq=False)
class _Part:
    """Rows of one kind in one state. points (k, 3) mm at rest, of each row. reader (k, n)."""

    name: str
    points: FloatArray
    reader: FloatArray


def data_split(fit: PlainFit, rules: DecisionRules) -> Split:
    """Blocks of space, each with the surface and the matched motion in it, then one of all landmarks; bones are never left out.

    Parts: distances along the organ's normal where it was drawn; motion inside the organ and in the tissue around, mm an axis, where
    images show it. A block is left out of all deformed states at once, for they share the scan at rest. With images it is as wide as
    two lengths over which motion is matched, else as two of contour noise.
    """
    found = sorted(_parts(fit, rules), key=lambda part: _PARTS.index(part.name))
    points, read = np.vstack([p.points for p in found]), np.vstack([p.reader for p in found])
    seen = np.concatenate(
        [_seen(data, rows) for data, rows in zip(fit.model.data_vectors, fit.model.rows, strict=True)]
    )
    reader = np.vstack([read, np.delete(np.eye(fit.model.n), seen, axis=0)])
    images = any(data.n_motion for data in fit.model.data_vectors)
    patch = np.full(len(reader), -1)
    patch[: len(points)] = blocks(points, 2.0 * (MOTION_LENGTH_MM if images else fit.options.mode_length_mm))
    rest = [(data.n - data.n_modes - data.n_motion, 3 * data.n_marks) for data in fit.model.data_vectors]
    marks = np.concatenate([np.arange(n) < count for n, count in rest])
    if marks.any():
        patch[len(points) + np.flatnonzero(marks)] = patch.max() + 1
    covariance = reader @ fit.weighting.covariance @ reader.T
    covariance[np.arange(len(points)), np.arange(len(points))] += fit.options.patch_nugget_mm**2
    return Split(reader, patch, covariance, _slices(found))


def _seen(data: DataVector, rows: slice) -> IntArray:
    """Rows of a state's surface modes and matched motion among all data."""
    at = np.arange(data.n)
    here = (at < data.n_modes) | ((at >= data.motion.start) & (at < data.motion.stop))
    return np.asarray(rows.start + at[here])


def _slices(found: Sequence[_Part]) -> dict[str, slice]:
    """Rows of each kind there is, which lie one after the other."""
    out, start = {}, 0
    for name in _PARTS:
        end = start + sum(len(part.points) for part in found if part.name == name)
        if end > start:
            out[name] = slice(start, end)
        start = end
    return out


def _parts(fit: PlainFit, rules: DecisionRules) -> Iterator[_Part]:
    """What every state shows."""
    for at, data, rows in zip(fit.linearisation.each, fit.model.data_vectors, fit.model.rows, strict=True):
        observation = at.scene.observation
        if data.n_modes:
            chosen = _thinned(observation.points, rules.point_spacing_mm)
            own = np.zeros((len(chosen), fit.model.n))
            own[:, rows.start : rows.start + data.n_modes] = data.modes[chosen]
            yield _Part(SURFACE, observation.points[chosen], own)
        if not data.n_motion:
            continue
        seen = observation.motion
        distance = cKDTree(observation.points).query(seen.rows.places)[0]
        near = np.flatnonzero(distance <= max(rules.near_mm, distance.min()))
        chosen = near[_thinned(seen.rows.places[near], MOTION_LENGTH_MM)]
        inside = _in_organ(at, seen.rows.places[chosen])
        read = motion_in_mm(seen.rows, seen.reader)
        for name, places in ((INSIDE, chosen[inside]), (TISSUE, chosen[~inside])):
            own = np.zeros((3 * len(places), fit.model.n))
            own[:, rows.start + data.motion.start : rows.start + data.motion.stop] = read[places].reshape(
                -1, data.n_motion
            )
            yield _Part(name, np.repeat(seen.rows.places[places], 3, axis=0), own)


def _in_organ(at: Linearisation, places: FloatArray) -> BoolArray:
    """Which places (w, 3) mm lie in a cell of the organ."""
    mesh = at.scene.space.mesh
    cells, _ = locate(mesh, places)
    return np.isin(mesh.regions[cells], at.scene.problem.regions)


def _thinned(points: FloatArray, spacing: float) -> IntArray:
    cube = np.floor(points / spacing).astype(np.int64)
    _, first = np.unique(cube, axis=0, return_index=True)
    return np.sort(first)


def blocks(points: FloatArray, width: float) -> IntArray:
    """Block of each point (p, 3) mm: Voronoi cells of seeds, each the point farthest from those before, until none is farther than
    `width` from a seed."""
    seeds = [int(np.argmin(points[:, 2]))]
    distance = np.linalg.norm(points - points[seeds[0]], axis=1)
    while distance.max() > width:
        seeds.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[seeds[-1]], axis=1))
    return np.argmin(np.linalg.norm(points[:, None] - points[seeds], axis=2), axis=1)
