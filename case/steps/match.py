"""The match step of a case: motion of the tissue between the two scans, from their images."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.matched import FILE, has_both_scans, read_matched_motion
from palpate.case.meshed import rigid_offset_of
from palpate.case.problem import problem_of
from palpate.case.steps.declarations import MATCH
from palpate.core.arrays import FloatArray
from palpate.core.fem.space import Space, locate
from palpate.core.forward.composition_scene import plain_scene
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.inference.starts import middle
from palpate.core.matched_motion import MatchedMotion
from palpate.core.mesh import TetMesh
from palpate.core.problem import IdentificationProblem
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.matching.local_matching import MATCHING, MatchOptions
from palpate.imaging.matching.scan_pair import Motion
from palpate.imaging.matching.two_scans import LabelledScan, matched_motion
from palpate.imaging.volume import Volume

# Grid on which the motion is sampled, mm, and points that are looked for at once.
_GRID_MM, _AT_ONCE = 2.5, 50_000


def run(case: CaseFolder, options: MatchOptions | None = None, progress: Progress = silent) -> MatchedMotion | None:
    """Write matched_motion.npz of a meshed case and return it; None where the case does not hold both CTs.

    Matching starts from the model's own prediction at the middle of the stiffness's bounds. Nothing is done when scans,
    labels, mesh, options and the matching's form are those of the last run. Raises InputError when an earlier step has not
    been run, or when the scans do not overlap about the organ.
    """
    if not has_both_scans(case):
        return None
    options = options or MatchOptions()
    made_from = MATCH.made_from(case, asdict(options) | {"matching": MATCHING})
    if MATCH.is_done(case, made_from):
        return read_matched_motion(case)
    progress(0.0, "motion that the model predicts")
    problem = problem_of(case)
    predicted = sampled(predicted_motion(problem), problem.mesh).at
    progress(0.3, "reading both scans")
    rest, deformed = (LabelledScan(case.ct(state), case.labels(state)) for state in ("rest", "deformed"))
    offset = rigid_offset_of(case)
    if offset is not None:
        there = offset.deformed_to_rest
        deformed = LabelledScan(deformed.ct.moved(there), deformed.labels.moved(there))
    progress(0.4, "matching the scans about the organ")
    found = matched_motion(rest, deformed, predicted, options)
    case.write_npz(FILE, **found.arrays())
    MATCH.mark_done(case, made_from)
    progress(1.0, f"{len(found.points)} points matched, {len(found.rejected)} rejected")
    return found


def predicted_motion(problem: IdentificationProblem) -> Motion:
    """The motion that the model predicts in its mesh and, as it is at its edge, around it.

    No motion where the model has no equilibrium. Raises InputError when nothing drives or holds the organ.
    """
    scene = plain_scene(problem, "p1p1")
    equilibrium = scene.settle(middle(StiffnessParameters(problem.regions, problem.facts).bounds)).equilibrium
    moved = equilibrium.u if equilibrium.converged else np.zeros_like(equilibrium.u)
    return lambda points: _motion_at(scene.space, moved, points)


def sampled(motion: Motion, mesh: TetMesh) -> Volume:
    """A motion on a grid about a mesh, which is quickly asked.

    Tissue strains otherwise on both sides of an organ's surface: the grid is finer than a window, so that both sides keep
    their own.
    """
    low, high = mesh.points.min(axis=0) - _GRID_MM, mesh.points.max(axis=0) + _GRID_MM
    shape = tuple(np.ceil((high - low) / _GRID_MM).astype(int) + 1)
    points = low + _GRID_MM * np.moveaxis(np.indices(shape), 0, -1).reshape(-1, 3)
    values = np.vstack([motion(part) for part in np.array_split(points, 1 + len(points) // _AT_ONCE)])
    affine = np.diag([_GRID_MM, _GRID_MM, _GRID_MM, 1.0])
    affine[:3, 3] = low
    return Volume(values.reshape(*shape, 3), affine)


def _motion_at(space: Space, u: FloatArray, points: FloatArray) -> FloatArray:
    """Displacements (n, 3) mm at points (n, 3) mm, linear within cells; around the mesh that of its cell's nearest side."""
    cell, xi = locate(space.mesh, points)
    share = np.maximum(np.column_stack([1.0 - xi.sum(axis=1), xi]), 0.0)
    share /= share.sum(axis=1, keepdims=True)
    return np.asarray(np.einsum("nk,nki->ni", share, u[space.mesh.cells[cell]]))
