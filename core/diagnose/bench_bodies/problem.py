"""Problem of a bench test: a body, its supports, and states with loads, moved patches and markers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property

import msgspec
import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.forward.composition import PerAxis
from palpate.core.mesh import TetMesh
from palpate.core.problem import Facts, IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface

Vector = tuple[float, float, float]
NO_AXIS: PerAxis = (None, None, None)

# Number of the body's region in its mesh.
BODY = 1


@dataclass(frozen=True)
class PointLoad:
    """A dead force, N, at a point, mm."""

    at: Vector
    force_n: Vector


@dataclass(frozen=True)
class BodyState:
    """State of a body under known loads.

    rest, deformed : positions of the markers, mm; None along an axis that is not seen. sd_mm : standard deviation of
    their motion, by axis; None along an axis that none of them shows. gravity : m/s2. common : share of the variance
    that all markers have in common; None for that of markers on one holder.
    """

    name: str
    rest: tuple[Vector, ...]
    deformed: tuple[PerAxis, ...]
    sd_mm: PerAxis
    gravity: Vector
    loads: tuple[PointLoad, ...] = ()
    common: float | None = None

    @property
    def moved(self) -> FloatArray:
        """Motion (k, 3) mm of the markers, NaN where it is not seen."""
        return np.array(self.deformed, dtype=np.float64) - np.array(self.rest)

    @property
    def seen(self) -> BoolArray:
        """Along which axes (k, 3) each marker's motion is seen."""
        with_sd = np.array([sd is not None for sd in self.sd_mm])
        return np.isfinite(np.array(self.deformed, dtype=np.float64)) & with_sd


@dataclass(frozen=True)
class PatchFacts:
    """What is known of a patch of the surface.

    displacement_mm : prescribed; None along an axis where it is free. sd_mm : error of it, by axis. reaction_n : force
    that the patch exerts on the body, N; None where it was not measured. reaction_sd_n : its error. state : index of
    the one state that has it; None for a support, which holds in all.
    """

    name: str
    displacement_mm: PerAxis
    sd_mm: Vector = (0.0, 0.0, 0.0)
    reaction_n: PerAxis = NO_AXIS
    reaction_sd_n: PerAxis = NO_AXIS
    state: int | None = None


@dataclass(frozen=True, eq=False)
class BodyPatch:
    """Patch of the surface, faces (f, 3), that is held along some axes or moved. rim (r, 3) : faces that the patch's edge
    cuts, of which some are in it as a whole and some are not; none where the edge follows the body's own."""

    faces: IntArray
    facts: PatchFacts
    rim: IntArray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))

    def with_rim_toggled(self, chosen: BoolArray) -> BodyPatch:
        """The same with the chosen (r,) faces of the rim in it where they were not, and the other way round."""
        inside, toggled = ({tuple(f) for f in faces.tolist()} for faces in (self.faces, self.rim[chosen]))
        return replace(self, faces=np.array(sorted(inside ^ toggled), dtype=np.int64).reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class BodyProblem:
    """Problem of a bench test: one body, its supports and its states.

    mesh : of region BODY. held (f, 3) : boundary faces that supports hold along all axes; none where there are only
    patches. bounds_kpa : of the shear modulus G. model_gravity : whether the plain model has gravity. patches : supports
    along some axes, and patches that are moved.
    """

    mesh: TetMesh
    held: IntArray
    states: tuple[BodyState, ...]
    density_kg_m3: float
    bounds_kpa: tuple[float, float]
    model_gravity: bool
    patches: tuple[BodyPatch, ...] = ()

    @cached_property
    def shell(self) -> IdentificationProblem:
        """The body in the form in which effects know a problem: one region, its supports as bone, no walls."""
        nothing = Surface.empty()
        facts = Facts(bounds_kpa=self.bounds_kpa, outer_fixed=False)
        boundary = {"bone": self.held} if len(self.held) else {}
        return IdentificationProblem(self.mesh, boundary, {}, SurfacePair(nothing, nothing), facts, {BODY: "body"})

    def patches_in(self, state: int) -> list[BodyPatch]:
        """Patches that act in a state: supports first, so that what is moved in it counts where both lie."""
        supports = [p for p in self.patches if p.facts.state is None]
        return supports + [p for p in self.patches if p.facts.state == state]

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Arrays for numpy.savez; `from_arrays` is the inverse."""
        scalars = {k: getattr(self, k) for k in ("density_kg_m3", "bounds_kpa", "model_gravity")}
        stated = {"states": [asdict(s) for s in self.states], "patches": [asdict(p.facts) for p in self.patches]}
        out: dict[str, NDArray[np.generic]] = {
            "points": self.mesh.points,
            "cells": self.mesh.cells,
            "held": self.held,
            "scalars": np.frombuffer(json.dumps(scalars | stated).encode(), dtype=np.uint8),
        }
        for k, p in enumerate(self.patches):
            out |= {f"patch_{k}": p.faces, f"rim_{k}": p.rim}
        return out

    @classmethod
    def from_arrays(cls, data: Mapping[str, NDArray[np.generic]]) -> BodyProblem:
        """Problem from `arrays`. Raises InputError when the arrays are of something else."""
        try:
            stated = msgspec.json.decode(bytes(np.asarray(data["scalars"], dtype=np.uint8)), type=_Stated)
            cells = np.asarray(data["cells"], dtype=np.int64)
            mesh = TetMesh(np.asarray(data["points"], dtype=float), cells, np.full(len(cells), BODY))
            surfaces = [
                [np.asarray(data[f"{part}_{k}"], dtype=np.int64) for part in ("patch", "rim")]
                for k in range(len(stated.patches))
            ]
            held = np.asarray(data["held"], dtype=np.int64)
        except (KeyError, ValueError, msgspec.MsgspecError) as error:
            raise InputError(f"not the data of a body ({error}); run diagnose again") from error
        each = zip(surfaces, stated.patches, strict=True)
        patches = tuple(BodyPatch(faces, facts, rim) for (faces, rim), facts in each)
        return cls(mesh, held, stated.states, stated.density_kg_m3, stated.bounds_kpa, stated.model_gravity, patches)


class _Stated(msgspec.Struct):
    states: tuple[BodyState, ...]
    patches: tuple[PatchFacts, ...]
    density_kg_m3: float
    bounds_kpa: tuple[float, float]
    model_gravity: bool
