"""Planned deformations stated by their load: pressure in the rectum, and gravity that turns with the patient."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.stated_files import Density, check_density
from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.loads import body_force, traction
from palpate.core.fem.terms.pressure import FollowerPressure
from palpate.core.files.json_types import typed
from palpate.core.forward.known_loads import Loads
from palpate.core.problem import IdentificationProblem
from palpate.core.surfaces.triangles import area_vectors, areas

# Weight of 1 kg/m3 in kPa/mm, per m/s2.
_WEIGHT = 1e-6
_DENSITY = 1050.0
_SUPINE = (0.0, 9.81, 0.0)


def rectal_pressure(case: CaseFolder, problem: IdentificationProblem, amount: float) -> Loads:
    """Pressure in the rectum, `amount` kPa above that of the scan at rest. Raises InputError without a rectum."""
    faces = problem.boundary.get("rectum")
    if faces is None or not len(faces):
        raise InputError(f"{case.file('rest.nii.gz')} holds no rectum (label 6) for the pressure to act in; draw it")
    return lambda space: [FollowerPressure.on(space, faces, amount)]


def turned_gravity(case: CaseFolder, problem: IdentificationProblem, amount: float) -> Loads:
    """Gravity after a turn of the patient by `amount` degrees about the long axis. Urine loads the bladder's wall; the
    rectum holds gas.

    Gravity of the scan at rest is that of the case, supine where the case states none.
    """
    before = np.array(case.facts.gravity_rest or _SUPINE)
    angle = np.radians(amount)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    source = str(case.file("case.json"))
    density = typed(case.facts.other.get("density_kg_m3", _DENSITY), Density, f"{source}: density_kg_m3")
    check_density(density, source)
    change = _WEIGHT * density * (turn @ before - before)
    bladder = problem.boundary.get("bladder")

    def loads(space: Space) -> list[Term]:
        terms: list[Term] = [body_force(space, change)]
        if bladder is not None and len(bladder):
            terms.append(traction(space, bladder, _hydrostatic(problem.mesh.points, bladder, change)))
        return terms

    return loads


def _hydrostatic(points: FloatArray, faces: IntArray, change: FloatArray) -> FloatArray:
    """Traction (f, 3), kPa, on faces (f, 3): pressure of a fluid whose weight changes by `change` (3,) kPa/mm, zero at
    its centroid.
    """
    X = points[faces]
    vector, area = area_vectors(X), areas(X)[:, None]
    centre = X.mean(axis=1)
    pressure = (centre - (area * centre).sum(axis=0) / area.sum()) @ change
    return np.asarray(-pressure[:, None] * vector / area, dtype=np.float64)


NOTES = {
    "pressure": ("the walls' motion is predicted with the assumed stiffness; the bladder's wall is free to give way",),
    "posture": (
        "the bladder is taken to hold urine and the rectum gas; the spread is that of contours alone: `identify` leaves gravity out, "
        "so it would take what the organ sags by itself for stiffness",
    ),
}
LOADS: dict[str, Callable[[CaseFolder, IdentificationProblem, float], Loads]] = {
    "pressure": rectal_pressure,
    "posture": turned_gravity,
}
