"""The paper's Fig 8: how far a sphere in a cube is drawn out by a given force, over its stiffness relative to its surroundings.

Two materials that deform alike when sphere and surroundings are alike: linear elasticity in both, and Mooney-Rivlin in both.
The slope of each curve is what a change of stiffness can be seen by.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import ORGAN, TISSUE, sphere_in_cube
from palpate.core.fem.newton.newton import solve_equilibrium
from palpate.core.fem.scenes import cap_pull
from palpate.core.fem.space import Space
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent

# Of the linear body, kPa; under the load of `scenes.cap_pull` it is drawn out by a quarter.
LINEAR_G, POISSON = 20.0, 0.495
MATERIALS = ("linear", "nonlinear")


class SensitivityTable(TypedDict):
    """Curves over the relative stiffness, by material (`MATERIALS`), and where the nonlinear one is the steeper or the higher."""

    study: str
    cells: int
    element: str
    tissue_G_kpa: dict[str, float]
    relative: tuple[float, ...]
    axis_ratio: dict[str, list[float]]
    slope: dict[str, FloatArray]
    nonlinear_steeper_at: list[float]
    nonlinear_above_at: list[float]
    paper: str


@dataclass(frozen=True)
class SensitivityOptions:
    """divisions : of `meshes.sphere_in_cube`, n even, so that its poles are nodes. relative : G of the sphere over the tissue's."""

    divisions: tuple[int, int, int] = (4, 1, 3)
    element: str = "p2p1"
    relative: tuple[float, ...] = (0.3, 0.4, 0.55, 0.75, 1.0, 1.4, 2.0, 2.8, 4.0, 6.0, 9.0)

    @classmethod
    def quick(cls) -> SensitivityOptions:
        """Seconds."""
        return cls((2, 1, 1), "p2p1", (0.4, 0.7, 1.0, 2.0, 4.0))


def sensitivity(options: SensitivityOptions | None = None, progress: Progress = silent) -> SensitivityTable:
    """Axis ratio and its slope over the relative stiffness, for both materials. Raises ConvergenceError where a body has no equilibrium."""
    o = options or SensitivityOptions()
    with one_thread():
        body = _Body(o.divisions, o.element)
        wanted = body.axis_ratio("linear", LINEAR_G, 1.0)
        alike = _modulus_of_same_deformation(body, wanted)
        moduli = dict(zip(MATERIALS, (LINEAR_G, alike), strict=True))
        curves: dict[str, list[float]] = {name: [] for name in MATERIALS}
        for k, relative in enumerate(o.relative):
            progress(0.2 + 0.8 * k / len(o.relative), f"relative stiffness {relative:g}")
            for name in MATERIALS:
                curves[name].append(body.axis_ratio(name, moduli[name], relative))
    slopes = {name: np.gradient(np.array(curves[name]), np.array(o.relative)) for name in MATERIALS}
    steeper = np.abs(slopes["nonlinear"]) > np.abs(slopes["linear"])
    progress(1.0, "done")
    return {
        "study": "sensitivity",
        "cells": body.cells,
        "element": o.element,
        "tissue_G_kpa": moduli,
        "relative": o.relative,
        "axis_ratio": curves,
        "slope": slopes,
        "nonlinear_steeper_at": [r for r, yes in zip(o.relative, steeper, strict=True) if yes],
        "nonlinear_above_at": [
            r for r, a, b in zip(o.relative, curves["nonlinear"], curves["linear"], strict=True) if a > b
        ],
        "paper": "the nonlinear curve lies above the linear one, and its slope is almost always larger",
    }


def verdict(found: SensitivityTable) -> str:
    """What came out of the paper's claim, in words."""
    steeper, of = found["nonlinear_steeper_at"], found["relative"]
    if len(steeper) == len(of):
        return "the nonlinear curve is the steeper one at every relative stiffness, as the paper says"
    if not steeper:
        return (
            "the linear curve is the steeper one at every relative stiffness: the paper's claim does not come out here"
        )
    return (
        f"the nonlinear curve is the steeper one at {len(steeper)} of {len(of)} relative stiffnesses "
        f"({', '.join(f'{r:g}' for r in steeper)}), the linear one at the others: the paper says almost always"
    )


class _Body:
    """The sphere in the cube, both its caps pulled, its outer surface held."""

    def __init__(self, divisions: tuple[int, int, int], element: str) -> None:
        mesh = sphere_in_cube(*divisions)
        self.cells = len(mesh.cells)
        self.space = Space.of(mesh, element)
        held = np.isclose(np.abs(self.space.nodes).max(axis=1), np.abs(mesh.points).max())
        faces, _ = mesh.region_boundary((ORGAN,))
        self.surface = np.unique(self.space.face_nodes(faces))
        self.assembler = Assembler(self.space, np.repeat(~held, 3), [cap_pull(self.space, faces)])

    def axis_ratio(self, material: str, tissue_G: float, relative: float) -> float:
        """Length of the sphere along the pull over its width, of the deformed body."""
        make = _linear if material == "linear" else _mooney_rivlin
        found = solve_equilibrium(self.assembler, {ORGAN: make(relative * tissue_G), TISSUE: make(tissue_G)})
        if not found.converged:
            raise ConvergenceError(f"{material} sphere, {relative:g} times as stiff: {found.reason}")
        x = (self.space.nodes + found.u)[self.surface]
        return float(np.ptp(x[:, 2]) / (0.5 * (np.ptp(x[:, 0]) + np.ptp(x[:, 1]))))


def _modulus_of_same_deformation(body: _Body, wanted: float) -> float:
    """G of the Mooney-Rivlin body that is drawn out as far, by secants in its logarithm."""
    a, b = np.log(LINEAR_G), np.log(0.9 * LINEAR_G)
    at_a, at_b = (body.axis_ratio("nonlinear", float(np.exp(g)), 1.0) - wanted for g in (a, b))
    for _ in range(8):
        a, b, at_a = b, b - at_b * (b - a) / (at_b - at_a), at_b
        at_b = body.axis_ratio("nonlinear", float(np.exp(b)), 1.0) - wanted
        if abs(at_b) < 1e-6:
            break
    return float(np.exp(b))


def _linear(G: float) -> Material:
    return Material(LINEAR, np.array([G, bulk_modulus(G, POISSON)]))


def _mooney_rivlin(G: float) -> Material:
    return Material(MOONEY_RIVLIN, mooney_rivlin_parameters(G, bulk_modulus(G, POISSON)))
