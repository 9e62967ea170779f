"""Type of an effect: id, parameters phi with their prior, and the change of a composition; phi = 0 is the plain model."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition import Composition
from palpate.core.problem import IdentificationProblem

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Parameter:
    """name, unit; scale : standard deviation of phi's prior around 0; low, high : bounds of phi.

    physical : phi -> the value in `unit`, where phi itself is only a convenient coordinate of it. secondary : it
    refines another parameter (a place, an edge) and changes nothing while that one is 0. own : every deformed state has
    its own value (what happened between two scans, or in one of them); state : whose it is, None for what is the same
    in all. over_reference : phi is ln of how stiff one part of the tissue is over the other; motion does not tell which of the two has
    the stiffness that the case states.
    """

    name: str
    unit: str
    scale: float
    low: float = -np.inf
    high: float = np.inf
    physical: Callable[[float], float] = float
    secondary: bool = False
    own: bool = False
    state: int | None = None
    over_reference: bool = False


@dataclass(frozen=True, eq=False)
class Variant:
    """One form of an effect (a place, a direction). change : (composition, phi (k,)) -> composition.

    where : centre in mm LPS if the effect has one.
    """

    change: Callable[[Composition, FloatArray], Composition]
    name: str = ""
    where: Vector | None = None

    def applied(self, composition: Composition, phi: FloatArray) -> Composition:
        """Composition with the effect at phi (k,); the very same object at phi = 0."""
        return self.change(composition, phi) if np.any(phi) else composition


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Facts of a case by which an effect decides on its variants.

    gravity : (rest, deformed) m/s2 in patient coordinates as the case states them, each None when unknown.
    pressure_fields : name of a hollow organ -> displacement (points, 3) that filling it by 1 mm rms causes in the plain
    model. density_kg_m3 : of all that gravity pulls on.
    """

    problem: IdentificationProblem
    gravity: tuple[Vector | None, Vector | None] = (None, None)
    pressure_fields: Callable[[], dict[str, FloatArray]] = dict
    density_kg_m3: float = 1000.0

    @cached_property
    def cell_centres(self) -> FloatArray:
        """Centres (m, 3) mm of the mesh's cells."""
        mesh = self.problem.mesh
        return np.asarray(mesh.points[mesh.cells].mean(axis=1))

    @cached_property
    def organ_centre(self) -> FloatArray:
        """Centroid (3,) mm of the organ."""
        mesh = self.problem.mesh
        inside = np.isin(mesh.regions, self.problem.regions)
        return np.average(self.cell_centres[inside], axis=0, weights=mesh.volumes[inside])

    def spread_points(self, candidates: FloatArray, spacing_mm: float) -> FloatArray:
        """Means (k, 3) mm of the candidates (n, 3) mm in cubes of spacing_mm; deterministic."""
        cube = np.floor((candidates - self.organ_centre) / spacing_mm + 0.5).astype(np.int64)
        _, group = np.unique(cube, axis=0, return_inverse=True)
        group = group.ravel()
        count = np.bincount(group)
        means = np.stack([np.bincount(group, candidates[:, i]) / count for i in range(3)], axis=1)
        return means[count >= 0.35 * np.median(count)]


def _as_named(phi: Mapping[str, float]) -> str:
    return ""


@dataclass(frozen=True, eq=False)
class Effect:
    """An effect that a model may leave out.

    words : "the organ slides along its surroundings". parameters : of every variant. variants : where it could be; none
    when the case excludes it. settled_by : the measurement that shows this effect most clearly, in words. unlike : phi
    by name of its parameter -> why what fits best is not what the name means, in words; "" where it is. on_bench : False for
    what acts through neighbours, walls or contours, which a body on a bench does not have.
    """

    id: str
    words: str
    parameters: Sequence[Parameter]
    variants: Callable[[Surroundings], list[Variant]]
    settled_by: str
    unlike: Callable[[Mapping[str, float]], str] = _as_named
    on_bench: bool = True

    @property
    def scales(self) -> FloatArray:
        """Prior standard deviations (k,) of phi."""
        return np.array([p.scale for p in self.parameters])

    @property
    def bounds(self) -> FloatArray:
        """Lower and upper bounds (k, 2) of phi."""
        return np.array([[p.low, p.high] for p in self.parameters])

    def over(self, states: int) -> Effect:
        """The same effect for a case with `states` deformed states: parameters that are `own` occur once for each."""
        if states < 2 or not any(p.own for p in self.parameters):
            return self
        parameters = [replace(p, state=0 if p.own else None) for p in self.parameters]
        places = [list(range(len(parameters)))]  # for each state, the indices of its parameters
        for state in range(1, states):
            places.append(list(places[0]))
            for k, p in enumerate(self.parameters):
                if p.own:
                    places[-1][k] = len(parameters)
                    parameters.append(replace(p, name=f"{p.name}_{state + 1}", state=state))
        return replace(
            self,
            parameters=tuple(parameters),
            variants=lambda around: [_in_its_state(v, places) for v in self.variants(around)],
        )


def _in_its_state(variant: Variant, places: Sequence[Sequence[int]]) -> Variant:
    def change(composition: Composition, phi: FloatArray) -> Composition:
        return variant.applied(composition, phi[list(places[composition.state])])

    return replace(variant, change=change)
