"""Numerical problems of a meshed case: one for each deformed state."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.deformed_states import state_labels, state_landmarks
from palpate.case.matched import FILE as MATCHED
from palpate.case.matched import read_matched_motion
from palpate.case.measured_noise import measured_noise
from palpate.case.meshed import ORGAN_NAME, load_meshed, load_surfaces, rigid_offset_of
from palpate.case.slimmed import require_whole
from palpate.case.stated_files import further_states
from palpate.case.surface_errors import StatedErrors
from palpate.core.errors import InputError
from palpate.core.problem import Facts, IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface
from palpate.imaging.labels import LABELS
from palpate.imaging.propagation.drawn_walls import with_carried_walls
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import organ_surfaces, wall_surface
from palpate.meshing.partition import HOLE_NAMES
from palpate.meshing.voxel_errors import organ_voxel_errors, wall_voxel_errors

_WALLS = ("bladder", "rectum")
_ORGAN = (1, 2)


def problem_of(case: CaseFolder, image: bool = False) -> IdentificationProblem:
    """Problem of the first deformed state: mesh, walls, organ surfaces and landmarks, all in the rest frame, mm.

    image : with the motion that the images tell, where the match step has found it. Walls then move as contours and images say
    together. A deformed prostate that nobody drew is no datum beside it.

    Raises InputError when an earlier step has not been run, when a state shows no organ, or in a slimmed case.
    """
    for name in ("surfaces.npz", MATCHED) if image else ("surfaces.npz",):
        require_whole(case, name)
    meshed = load_meshed(case)
    rest, deformed = load_surfaces(case, "rest"), load_surfaces(case, "deformed")
    for state, surfaces in (("rest", rest), ("deformed", deformed)):
        if ORGAN_NAME not in surfaces:
            raise InputError(f"{case.file('surfaces.npz')} has no organ in the {state} state; run `palpate mesh` again")
    errors = StatedErrors(case)
    walls = {n: errors.pair(SurfacePair(rest[n], deformed[n]), n) for n in _WALLS if n in rest and n in deformed}
    present = sorted(set(np.unique(meshed.mesh.regions).tolist()) & set(_ORGAN))
    marks = case.landmarks()
    offset = rigid_offset_of(case)
    if marks is not None and offset is not None:
        marks = replace(marks, deformed=offset.back(marks.deformed))
    landmarks = np.zeros((0, 6)) if marks is None else np.hstack([marks.rest, marks.deformed])
    matched = read_matched_motion(case) if image else None
    drawn = IdentificationProblem(
        meshed.mesh,
        meshed.boundary,
        walls,
        errors.pair(SurfacePair(rest[ORGAN_NAME], deformed[ORGAN_NAME]), ORGAN_NAME),
        facts_of(case),
        {r: LABELS[r] for r in present},
        landmarks,
        matched,
        matched is None or errors.shows_motion(ORGAN_NAME),
    )
    return with_carried_walls(drawn)


def state_problems(case: CaseFolder, first: IdentificationProblem) -> list[IdentificationProblem]:
    """Problems of the further deformed states.

    first : problem of the first deformed state; its mesh and surfaces at rest are shared. Deformed surfaces and
    landmarks are each state's own. Raises InputError when a file of a state is missing or holds no prostate.
    """
    problems = []
    for state in further_states(case):
        labels, marks = state_labels(case, state), state_landmarks(case, state)
        surfaces = {name: _wall(labels, label) for label, name in HOLE_NAMES.items() if name in first.walls}
        walls = {n: SurfacePair(first.walls[n].rest, surface) for n, surface in surfaces.items() if len(surface.faces)}
        found = organ_surfaces(labels)
        found = replace(found, voxel_errors=organ_voxel_errors(labels, found.points))
        organ = SurfacePair(first.organ.rest, found)
        landmarks = np.zeros((0, 6)) if marks is None else np.hstack([marks.rest, marks.deformed])
        problems.append(replace(first, walls=walls, organ=organ, landmarks=landmarks, matched=None, organ_drawn=True))
    return problems


def _wall(labels: Volume, label: int) -> Surface:
    found = wall_surface(labels, label)
    return replace(found, voxel_errors=wall_voxel_errors(labels, label, found.points)) if len(found.faces) else found


def facts_of(case: CaseFolder) -> Facts:
    """Scalars that the model needs. Contour noise is the stated value, else the measured one, else that of `Facts`, which is of
    surfaces that state no errors of their own (`surface_errors`).

    Raises InputError when noise.json or surface_errors.npz is damaged.
    """
    facts = case.facts
    measured = None if facts.boundary_noise_sd_mm is not None else measured_noise(case)
    estimated = StatedErrors(case)
    usual = estimated.correlation_mm if estimated else Facts.noise_correlation_mm
    sd, length = measured or (facts.boundary_noise_sd_mm or Facts.noise_sd_mm, usual)
    return Facts(
        tissue_shear_modulus_kpa=facts.tissue_shear_modulus_kpa,
        tissue_poisson_ratio=facts.tissue_poisson_ratio,
        bounds_kpa=facts.organ_shear_modulus_bounds_kpa,
        noise_sd_mm=sd,
        noise_correlation_mm=length,
        outer_fixed=facts.outer_surface == "fixed",
    )


def noise_source(case: CaseFolder) -> Literal["case", "repeats", "image", "assumed"]:
    """Source of the contour noise: "case" (stated in case.json), "repeats" (measured, noise.json), "image" (estimated by the
    segmentation, surface_errors.npz; what nobody estimated is assumed) or "assumed"."""
    if case.facts.boundary_noise_sd_mm is not None:
        return "case"
    if measured_noise(case) is not None:
        return "repeats"
    return "image" if StatedErrors(case) else "assumed"
