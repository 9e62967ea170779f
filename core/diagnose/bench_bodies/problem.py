"""Problem of a bench test: a body, its supports, and states with loads and markers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.mesh import TetMesh
from palpate.core.problem import Facts, IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface

Vector = tuple[float, float, float]

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

    rest, deformed : positions of the markers, mm. sd_mm : standard deviation of their motion per axis. gravity : m/s2.
    """

    name: str
    rest: tuple[Vector, ...]
    deformed: tuple[Vector, ...]
    sd_mm: float
    gravity: Vector
    loads: tuple[PointLoad, ...] = ()

    @property
    def moved(self) -> FloatArray:
        """Motion (k, 3) mm of the markers."""
        return np.subtract(self.deformed, self.rest)

    def covariance(self, common: float) -> FloatArray:
        """Covariance (3 k, 3 k) mm2 of the markers' motions; `common` is the share of variance that all share."""
        k = len(self.rest)
        markers = common * np.ones((k, k)) + (1.0 - common) * np.eye(k)
        return np.asarray(self.sd_mm**2 * np.kron(markers, np.eye(3)))


@dataclass(frozen=True, eq=False)
class BodyProblem:
    """Problem of a bench test: one body, its supports and its states.

    mesh : of region BODY. held (f, 3) : boundary faces that supports hold. bounds_kpa : of the shear modulus G.
    model_gravity : whether the plain model has gravity.
    """

    mesh: TetMesh
    held: IntArray
    states: tuple[BodyState, ...]
    density_kg_m3: float
    bounds_kpa: tuple[float, float]
    model_gravity: bool

    @cached_property
    def shell(self) -> IdentificationProblem:
        """The body in the form in which effects know a problem: one region, its supports as bone, no walls."""
        nothing = Surface.empty()
        facts = Facts(bounds_kpa=self.bounds_kpa)
        return IdentificationProblem(
            self.mesh, {"bone": self.held}, {}, SurfacePair(nothing, nothing), facts, {BODY: "body"}
        )

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Arrays for numpy.savez; `from_arrays` is the inverse."""
        rest = {k: getattr(self, k) for k in ("density_kg_m3", "bounds_kpa", "model_gravity")}
        text = json.dumps(rest | {"states": [asdict(s) for s in self.states]})
        return {
            "points": self.mesh.points,
            "cells": self.mesh.cells,
            "held": self.held,
            "scalars": np.frombuffer(text.encode(), dtype=np.uint8),
        }

    @classmethod
    def from_arrays(cls, data: Mapping[str, NDArray[np.generic]]) -> BodyProblem:
        """Problem from `arrays`. Raises InputError when the arrays are of something else."""
        try:
            scalars = json.loads(bytes(np.asarray(data["scalars"], dtype=np.uint8)).decode())
            cells = np.asarray(data["cells"], dtype=np.int64)
            mesh = TetMesh(np.asarray(data["points"], dtype=float), cells, np.full(len(cells), BODY))
            states = tuple(_state(s) for s in scalars["states"])
            low, high = scalars["bounds_kpa"]
            held = np.asarray(data["held"], dtype=np.int64)
            return cls(mesh, held, states, scalars["density_kg_m3"], (low, high), scalars["model_gravity"])
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(f"not the data of a body ({error}); run diagnose again") from error


def _state(data: dict[str, object]) -> BodyState:
    loads = tuple(PointLoad(tuple(x["at"]), tuple(x["force_n"])) for x in data.pop("loads"))  # type: ignore[attr-defined]
    markers = {key: tuple(tuple(x) for x in data.pop(key)) for key in ("rest", "deformed")}  # type: ignore[attr-defined]
    return BodyState(**markers, loads=loads, **{k: tuple(v) if isinstance(v, list) else v for k, v in data.items()})  # type: ignore[arg-type]
