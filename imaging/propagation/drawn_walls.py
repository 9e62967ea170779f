"""Walls of hollow organs that both contours show, moved as images and contours together say.

A contour's error drives the model where a wall is taken to have gone exactly to the deformed contour. The images show how the
tissue beside the wall moved. Both are data of one motion (`TissueMotion`): displacements of windows, and along the normal
the distance of a wall from its deformed contour. Where contours are good they decide, where they err by a millimetre the
images do. The wall is then carried over by that motion: it errs in the deformed scan as at rest, and by what the motion may
be off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray
from palpate.core.forward.scene_parts import driving_walls
from palpate.core.matched_motion import MatchedMotion
from palpate.core.observe.contour_errors import ContourErrors
from palpate.core.observe.voxel_noise import VoxelNoise
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.surface import Surface
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.imaging.propagation.displacements import Displacements
from palpate.imaging.propagation.motion_prior import SurfacePoints, Walls
from palpate.imaging.propagation.options import PropagationOptions
from palpate.imaging.propagation.tissue_motion import TissueMotion, tissue_motion, usual_motion
from palpate.imaging.propagation.window_motions import along_axes

# Points of one wall whose distance from the deformed contour is compared, at most: closer than its errors go together. And points that
# are asked for how far the motion may be off.
_POINTS, _ASKED = 150, 300


def with_carried_walls(
    problem: IdentificationProblem, options: PropagationOptions | None = None
) -> IdentificationProblem:
    """The problem with its drawn walls carried over to the deformed scan by what images and contours say together.

    Unchanged where no image tells a motion. A wall that only the images carried over stays as it is.
    """
    matched = problem.matched
    drawn = _drawn(problem) if matched is not None and matched.is_of_one_body else {}
    if matched is None or not drawn:
        return problem
    motion = _motion(problem, drawn, matched, options or PropagationOptions())
    carried = {name: _carried(wall, motion) for name, wall in drawn.items()}
    return replace(problem, walls={**problem.walls, **carried})


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A wall that both scans' contours show. points (q, 3) mm : of it at rest, where the mesh has it. normals (q, 3)."""

    pair: SurfacePair
    points: FloatArray
    normals: FloatArray


def _drawn(problem: IdentificationProblem) -> dict[str, _Drawn]:
    out, within = {}, WallMotionOptions().seen_within_mm
    for name, pair in driving_walls(problem).items():
        tree = TriangleTree.of(problem.mesh.points, problem.boundary[name])
        seen = np.flatnonzero(closest_points(tree, pair.rest.points).distance < within)
        if not pair.carried_to and len(seen):
            out[name] = _Drawn(pair, pair.rest.points[seen], pair.rest.point_normals[seen])
    return out


def _motion(
    problem: IdentificationProblem, drawn: Mapping[str, _Drawn], matched: MatchedMotion, options: PropagationOptions
) -> TissueMotion:
    """Of the tissue at the walls."""
    # Windows are half as wide as their errors go together.
    windows = along_axes(
        matched.points, matched.moved, matched.precision, options.strain * 0.5 * matched.correlation_mm
    )
    tree = cKDTree(np.vstack([wall.points for wall in drawn.values()]))
    windows = windows.chosen(tree.query(windows.points)[0] < options.reach_mm)
    walls = Walls([SurfacePoints(wall.points, wall.normals) for wall in drawn.values()], options.wall_fade_mm)
    contours = _of_contours(problem, drawn, usual_motion(windows, walls, options))
    return tissue_motion(windows.joined(contours), walls, options)


def _of_contours(problem: IdentificationProblem, drawn: Mapping[str, _Drawn], motion: TissueMotion) -> Displacements:
    """Displacement of walls along the normal of the deformed contour, near which a motion brings them."""
    points, directions, along, errors = [], [], [], []
    for wall in drawn.values():
        chosen = np.random.default_rng(0).permutation(len(wall.points))[:_POINTS]
        at = wall.points[chosen]
        moved = at + motion.at(at)
        gap, normal = _distance(wall.pair.deformed, moved)
        points.append(at)
        directions.append(normal)
        along.append((normal * (moved - at)).sum(axis=1) - gap)
        errors.append(_errors(problem, wall.pair, at, moved))
    together = block_diag(*errors)
    own = np.full(len(together), WallMotionOptions().voxels_mm ** 2)
    return Displacements(np.vstack(points), np.vstack(directions), np.concatenate(along), own, together)


def _errors(problem: IdentificationProblem, pair: SurfacePair, at: FloatArray, moved: FloatArray) -> FloatArray:
    """Covariance (q, q) mm2 of the difference of both contours' errors at points (q, 3) mm, of any length that they may have."""
    options, contours = NoiseModelOptions(), ContourErrors.of(pair, at, moved, problem.facts.noise_sd_mm)
    each = [contours.covariance(contours, length, same_state=True) for length in options.lengths_mm]
    voxels = VoxelNoise.of(pair, at, moved)
    at_rest, deformed = voxels.covariances(voxels, options.voxel_length_mm)
    return np.asarray(np.mean(each, axis=0) + at_rest + deformed)


def _distance(surface: Surface, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Signed distance (n,) mm of points (n, 3) mm from a surface, and its unit normal (n, 3) where it is nearest."""
    tree = TriangleTree.of(surface.points, surface.faces)
    near = closest_points(tree, points)
    normal = np.einsum("qc,qca->qa", near.barycentric, _unit(tree.normals[near.triangle, 1:4]))
    return near.signed, _unit(normal)


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))


def _carried(wall: _Drawn, motion: TissueMotion) -> SurfacePair:
    """The wall of both scans, with the deformed one where the motion takes the one at rest; far from the mesh it goes as the
    nearest place that the mesh has."""
    rest = wall.pair.rest
    moved = motion.at(wall.points)[cKDTree(wall.points).query(rest.points)[1]]
    few = slice(None, None, 1 + len(wall.points) // _ASKED)
    error = motion.error(wall.points[few], wall.normals[few])
    sd = error[cKDTree(wall.points[few]).query(rest.points)[1]]
    at_rest = replace(rest, voxel_errors=None)
    return SurfacePair(at_rest, Surface(rest.points + moved, rest.faces, rest.region, sd), 0.0, "deformed")
