"""Rigid motion of the bones between the scans: another pose, or scans that are not aligned."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant
from palpate.core.surfaces.rigid_motion import rigid_motion

# Distance from bone over which the region's edge moves along with it, mm: none, near bone, or, for scans that are not
# aligned, everywhere.
_EDGES_MM = {"edge held": 0.0, "edge near bone goes along": 20.0, "edge goes along": np.inf}


def _variants(around: Surroundings) -> list[Variant]:
    if "bone" not in around.problem.boundary:
        return []
    outer = around.problem.facts.outer_fixed and "outer" in around.problem.boundary
    edges = _EDGES_MM if outer else {"": 0.0}
    return [Variant(_moving(around.organ_centre, reach), name) for name, reach in edges.items()]


def _moving(pivot: FloatArray, edge_mm: float) -> Callable[[Composition, FloatArray], Composition]:
    def change(composition: Composition, phi: FloatArray) -> Composition:
        return composition.with_support(lambda X: rigid_motion(X, pivot, phi), edge_mm)

    return change


EFFECT = Effect(
    "bone_motion",
    "the bones moved between the scans, or the scans are not aligned on them",
    (
        *(Parameter(f"translation_{axis}", "mm", 2.0, -15.0, 15.0, own=True) for axis in "xyz"),
        *(Parameter(f"rotation_{axis}", "deg", 2.5, -20.0, 20.0, own=True) for axis in "xyz"),
    ),
    _variants,
    "an alignment of the two scans on bone that is checked by eye, or a scan in the first one's posture",
)
