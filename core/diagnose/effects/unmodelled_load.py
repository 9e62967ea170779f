"""Load on the organ by something that the scans do not show."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.loads import traction
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant
from palpate.core.surfaces.triangles import area_vectors

# Standard deviation of the pressure's profile, mm: the load is a centimetre or two across (chosen). Distance between
# the places that are tried, mm.
_RADIUS_MM, _SPACING_MM = 6.0, 10.0


def _radius(phi: float) -> float:
    return _RADIUS_MM + phi


def _variants(around: Surroundings) -> list[Variant]:
    problem = around.problem
    faces, _ = problem.mesh.region_boundary(problem.regions)
    at, area = _faces(problem.mesh.points[faces])
    return [_variant(around, c, _normal(at, area, c)) for c in around.spread_points(at, _SPACING_MM)]


def _faces(X: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Centres (f, 3) mm and outward area vectors (f, 3) mm2 of triangles (f, 3, 3)."""
    return X.mean(axis=1), area_vectors(X)


def _normal(at: FloatArray, area: FloatArray, centre: FloatArray) -> FloatArray:
    """Mean outward unit normal (3,) of the faces around a centre (3,) mm."""
    mean = _share(at, centre, _RADIUS_MM) @ area
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-30))


def _share(at: FloatArray, centre: FloatArray, radius: float) -> FloatArray:
    return np.asarray(np.exp(-0.5 * ((at - centre) ** 2).sum(axis=1) / radius**2))


def _variant(around: Surroundings, centre: FloatArray, outward: FloatArray) -> Variant:
    # Any two orthonormal directions along the surface.
    along = np.linalg.svd(outward[None])[2][1:]

    def change(composition: Composition, phi: FloatArray) -> Composition:
        def load(space: Space) -> Term:
            faces, _ = space.mesh.region_boundary(composition.problem.regions)
            at, area = _faces(space.mesh.points[faces])
            share = _share(at, centre + phi[3:6], _radius(float(phi[6])))
            near = share > 1e-3 * share.max()
            normal = area[near] / np.linalg.norm(area[near], axis=1)[:, None]
            return traction(space, faces[near], share[near, None] * (phi[1:3] @ along - phi[0] * normal))

        return composition.with_load(load)

    x, y, z = centre.tolist()
    return Variant(change, f"at ({x:.0f}, {y:.0f}, {z:.0f})", (x, y, z))


def _pulls(phi: Mapping[str, float]) -> str:
    """Why a load that fits best with a pull is not this effect: what only lies against the organ cannot pull at it."""
    pressures = [value for name, value in phi.items() if name.startswith("pressure")]
    if max(pressures, key=abs) >= 0.0:
        return ""
    return (
        "what is missing pulls at the organ, which nothing that pushes does: a scar that shrank, an adhesion or a "
        "tear would, and the "
        "library has no name for them"
    )


EFFECT = Effect(
    "unmodelled_load",
    "something that the scans do not show pushes on the organ",
    (
        Parameter("pressure", "kPa", 25.0, -120.0, 120.0, own=True),
        Parameter("shear_1", "kPa", 8.0, -60.0, 60.0, own=True),
        Parameter("shear_2", "kPa", 8.0, -60.0, 60.0, own=True),
        Parameter("shift_x", "mm", 3.5, -9.0, 9.0, secondary=True),
        Parameter("shift_y", "mm", 3.5, -9.0, 9.0, secondary=True),
        Parameter("shift_z", "mm", 3.5, -9.0, 9.0, secondary=True),
        Parameter("radius", "mm", 2.0, -3.5, 7.0, _radius, secondary=True),
    ),
    _variants,
    "the region next to the organ at the marked place, scanned again or with another modality",
    _pulls,
)
