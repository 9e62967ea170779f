"""Error of an organ's surface along its normal, by place, from the picture's edge and from what perturbed runs do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.statistics import rms
from palpate.core.surfaces.triangles import areas, enclosed_volume
from palpate.imaging.volume import Volume
from palpate.segmentation.error_estimate import FLOOR_MM, MOST_MM, Clues, ErrorModel, error_models
from palpate.segmentation.methods.surface_mesh import Shell, profiles, shell_of_mask
from palpate.segmentation.perturbed_runs import PerturbationOptions, perturbed_organs
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.search_region import Found, Scene
from palpate.segmentation.working_grid import blurred, bounds, distance_of

# Resolution: distance of the points at which an error is given, mm; the shell's smoothing, and over how far what runs do is
# averaged, mm.
SPACING_MM, SHELL_MM, NEAR_MM = 3.0, 1.0, 6.0
# Edges are read on a picture so much smoothed, so far inside and outside of the surface, mm.
EDGE_BLUR_MM, INSIDE_MM, OUTSIDE_MM = 0.8, (-4.0, -1.0), (1.0, 4.0)
# A surface so near to the grid's end, in voxels, is a cap.
END_VOXELS = 2.5
# Contrast of soft tissue against fat, HU: an edge of it is a whole one.
WHOLE_HU = 80.0


@dataclass(frozen=True, eq=False)
class SurfaceErrors:
    """points (n, 3) mm of an organ's surface, sd_mm (n,) the standard deviation of its error there, along the normal.

    expected_dice : Dice with the true organ that errors of this size leave on average.
    """

    points: FloatArray
    sd_mm: FloatArray
    expected_dice: float


def surface_errors(
    scene: Scene,
    prompts: Prompts,
    organs: Mapping[str, Found],
    seed: int = 1,
    options: PerturbationOptions | None = None,
) -> dict[str, SurfaceErrors]:
    """Errors of the organs that the program has found, by name; those of a person or a model are left out.

    Same seed, same answer.
    """
    models = error_models()
    own = {name: found for name, found in organs.items() if name in models and found.method in MODES}
    if not own:
        return {}
    given = {name: found for name, found in organs.items() if name not in own}
    runs = perturbed_organs(scene, prompts, given, seed, options)
    return {name: errors_of(scene, found, [run.get(name) for run in runs], models[name]) for name, found in own.items()}


# How an organ was found: automatically, or led by points.
MODES = {"auto": 0.0, "carried": 0.0, "click": 0.0, "box": 1.0, "extremes": 1.0}


def errors_of(scene: Scene, found: Found, runs: Sequence[Volume | None], model: ErrorModel) -> SurfaceErrors:
    """Errors of one organ. runs : its mask in every perturbed run, None where a run did not find it."""
    shell = shell_of_mask(found.mask, scene.grid, SHELL_MM)
    chosen = spread_points(shell, scene.grid)
    clues = clues_of(scene, shell, chosen, found, runs)
    sd = np.clip(model.sd_mm(clues), FLOOR_MM, MOST_MM)
    return SurfaceErrors(shell.points[chosen], sd, expected_dice(shell, chosen, sd))


def clues_of(scene: Scene, shell: Shell, chosen: IntArray, found: Found, runs: Sequence[Volume | None]) -> Clues:
    """What speaks for and against the surface at the chosen of its points."""
    points = shell.points[chosen]
    # The middle one: a run that fails by a landmark that was put far off speaks of the landmark.
    usual = np.median(np.abs(_distances(runs, points)), axis=0)
    local = np.sqrt(_averaged(points, usual**2))
    bare = _weakness(scene, points, shell.normals[chosen])
    weak = _averaged(points, bare)
    low, high = points[:, 2].min(), points[:, 2].max()
    ends = np.minimum(points[:, 2] - low, high - points[:, 2])
    even = np.ones(len(points))
    whole = rms(usual) * even
    return Clues(
        local, whole, weak, float(bare.mean()) * even, ends, MODES[found.method] * even, (1.0 - found.confidence) * even
    )


def spread_points(shell: Shell, grid: Volume) -> IntArray:
    """Points of a shell about SPACING_MM apart, one of each cube; none where the grid ends rather than the organ, unless
    there are no others."""
    low, high = bounds(grid)
    room = END_VOXELS * float(grid.spacing[0])
    within = np.flatnonzero(((shell.points > low + room) & (shell.points < high - room)).all(axis=1))
    within = within if len(within) else np.arange(len(shell.points))
    cubes = np.floor(shell.points[within] / SPACING_MM).astype(np.int64)
    return np.asarray(within[np.sort(np.unique(cubes, axis=0, return_index=True)[1])])


def expected_dice(shell: Shell, chosen: IntArray, sd_mm: FloatArray) -> float:
    """Dice that normal errors along the surface leave: 1 - A E|e| / 2 V, for what two masks do not share is a layer of the
    thickness |e| about the surface's area A, and their volumes V are about equal. sd_mm (n,) : at the chosen points."""
    nearest = cKDTree(shell.points[chosen]).query(shell.points[shell.faces].mean(axis=1))[1]
    layer = np.sqrt(2.0 / np.pi) * float((areas(shell.points[shell.faces]) * sd_mm[nearest]).sum())
    return float(np.clip(1.0 - 0.5 * layer / enclosed_volume(shell.points, shell.faces), 0.0, 1.0))


def _distances(runs: Sequence[Volume | None], points: FloatArray) -> FloatArray:
    """Distances (r, n) mm of points from the surfaces of the runs that found the organ: a run without a surface says nothing of
    where it is. MOST_MM where most runs found none, 0 where there were no runs."""
    masks = [(run, run.array.astype(bool)) for run in runs if run is not None]
    found = [(run, mask) for run, mask in masks if mask.any() and not mask.all()]
    if 2 * len(found) <= len(runs):
        return np.full((1, len(points)), MOST_MM if runs else 0.0)
    return np.stack([np.clip(distance_of(points, mask, run), -MOST_MM, MOST_MM) for run, mask in found])


def _weakness(scene: Scene, points: FloatArray, normals: FloatArray) -> FloatArray:
    """0 where the picture falls by a whole contrast across the surface, 1 where it does not change, (n,).

    The urine of a bladder is darker than what surrounds it: a rise counts as a fall does.
    """
    sharp = scene.grid.with_array(blurred(scene.hu, EDGE_BLUR_MM, scene.step))
    inside, outside = (
        profiles(sharp, points, normals, np.linspace(*reach, 4)).mean(axis=1) for reach in (INSIDE_MM, OUTSIDE_MM)
    )
    return np.asarray(1.0 - np.clip(np.abs(inside - outside) / WHOLE_HU, 0.0, 1.0))


def _averaged(points: FloatArray, values: FloatArray) -> FloatArray:
    """Values (n,) averaged over neighbours within NEAR_MM."""
    tree = cKDTree(points)
    near = tree.sparse_distance_matrix(tree, 2.0 * NEAR_MM, output_type="coo_matrix")
    weight = near.tocsr()
    weight.data = np.exp(-0.5 * (weight.data / NEAR_MM) ** 2)
    total = np.asarray(weight.sum(axis=1)).ravel() + 1.0
    return np.asarray((weight @ values + values) / total)
