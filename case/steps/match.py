"""The match step of a case: motion of the tissue between the two scans, from their images."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from scipy.spatial import cKDTree

from palpate.case.case_folder import CaseFolder
from palpate.case.matched import FILE, has_both_scans, read_matched_motion
from palpate.case.meshed import rigid_offset_of
from palpate.case.problem import problem_of
from palpate.case.steps.declarations import MATCH
from palpate.core.arrays import FloatArray
from palpate.core.forward.composition_scene import plain_scene
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.inference.starts import middle
from palpate.core.matched_motion import MatchedMotion
from palpate.core.problem import IdentificationProblem
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.matching.local_matching import MatchOptions, Motion
from palpate.imaging.matching.two_scans import LabelledScan, matched_motion

# Nodes of the mesh whose motions are averaged for that of a point between them.
_NODES = 8


def run(case: CaseFolder, options: MatchOptions | None = None, progress: Progress = silent) -> MatchedMotion | None:
    """Write matched_motion.npz of a meshed case and return it; None where the case does not hold both CTs.

    Matching starts from the model's own prediction at the middle of the stiffness's bounds. Nothing is done when scans,
    labels, mesh and options are those of the last run. Raises InputError when an earlier step has not been run, or when
    the scans do not overlap about the organ.
    """
    if not has_both_scans(case):
        return None
    options = options or MatchOptions()
    made_from = MATCH.made_from(case, asdict(options))
    if MATCH.is_done(case, made_from):
        return read_matched_motion(case)
    progress(0.0, "motion that the model predicts")
    predicted = predicted_motion(problem_of(case))
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
    """The motion that the model predicts, between the nodes of its mesh and, as it is at the nearest ones, around it.

    No motion where the model has no equilibrium. Raises InputError when nothing drives or holds the organ.
    """
    scene = plain_scene(problem, "p1p1")
    equilibrium = scene.settle(middle(StiffnessParameters(problem.regions, problem.facts).bounds)).equilibrium
    moved = equilibrium.u if equilibrium.converged else np.zeros_like(equilibrium.u)
    tree = cKDTree(scene.space.nodes)

    def motion(points: FloatArray) -> FloatArray:
        distance, near = tree.query(points, k=_NODES)
        weight = 1.0 / np.maximum(distance, 1e-3) ** 2
        return np.asarray(np.einsum("nk,nki->ni", weight / weight.sum(axis=1, keepdims=True), moved[near]))

    return motion
