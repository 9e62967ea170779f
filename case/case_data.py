"""What the inference sees of a meshed case: the problem and the bones of every deformed state."""

from __future__ import annotations

from dataclasses import replace

from palpate.case.case_folder import CaseFolder
from palpate.case.deformed_states import state_labels
from palpate.case.meshed import load_surfaces
from palpate.case.problem import problem_of, state_problems
from palpate.case.stated_files import further_states
from palpate.core.problem import Facts, SurfacePair
from palpate.core.residual.case_data import CaseData
from palpate.core.surfaces.surface import Surface
from palpate.imaging.labels import BONE
from palpate.meshing.label_surfaces import wall_surface


def data_of(case: CaseFolder, image: bool = False, law: str = Facts.organ_law) -> CaseData:
    """Data of a meshed case. image : with the motion that the match step has found. law : of the organ, by name."""
    rest, deformed = load_surfaces(case, "rest"), load_surfaces(case, "deformed")
    bones = SurfacePair(rest["bone"], deformed["bone"]) if "bone" in rest and "bone" in deformed else None
    first = problem_of(case, image)
    first = replace(first, facts=replace(first.facts, organ_law=law))
    more = zip(state_problems(case, first), _further_bones(case, rest.get("bone")), strict=True)
    return CaseData(first, bones, (case.facts.gravity_rest, case.facts.gravity_deformed), more=tuple(more))


def _further_bones(case: CaseFolder, at_rest: Surface | None) -> list[SurfacePair | None]:
    """Of every further deformed state; None where either shows none."""
    seen = [wall_surface(state_labels(case, state), BONE) for state in further_states(case)]
    return [SurfacePair(at_rest, bone) if at_rest is not None and len(bone.faces) else None for bone in seen]
