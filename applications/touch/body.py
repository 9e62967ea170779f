"""The touched body: regions with their stiffness, and its support."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from palpate.applications.touch.probe import Grip, Press
from palpate.applications.touch.surface import ContactSurface
from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import PointSet, Term
from palpate.core.fem.terms.springs import Springs
from palpate.core.laws import MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters
from palpate.core.mesh import TetMesh

SUPPORTS = {
    "bed": "the organ alone, on springs all over its surface that yield as the removed tissue around it would",
    "table": "the organ alone, its back stuck to a rigid table",
    "none": "nothing but the nodes that are named",
}
# Linear displacement and pressure: free of locking; one solve with the factor of 4,000 cells takes a third of a
# millisecond (measured).
ELEMENT = "p1p1"
# Depth that the table holds, from the rearmost point, as a share of the organ's depth.
_TABLE = 0.15
# Contact stiffness times a face's edge over its G. A stiffer contact makes faces as large as the contact act like flat
# stamps. With this value the mean force at random places of a ball with 5.2 mm edges under a probe of 8 mm is within 5
# % from 2 mm of depth on, against a fine mesh that agrees with Hertz (measured).
_CONTACT = 25.0
# Largest contact pressure over G that an equilibrium is expected to have.
_DEEPEST = 4.0


@dataclass(frozen=True, eq=False)
class Body:
    """A mesh, the shear modulus of its regions (kPa), and what holds it.

    names : region id -> name. interval_kpa : 95 % interval of the shear moduli where known; shown only, no result
    depends on it. tissue_kpa : shear modulus of the surrounding tissue, for the bed. fixed : (n,) nodes that do not
    move, besides the support's own.
    """

    mesh: TetMesh
    shear_kpa: Mapping[int, float]
    names: Mapping[int, str]
    support: str = "bed"
    tissue_kpa: float = 20.0
    poisson_ratio: float = 0.495
    fixed: IntArray | None = None
    interval_kpa: Mapping[int, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.support not in SUPPORTS:
            raise InputError(f"support {self.support!r} is unknown; choose one of {', '.join(SUPPORTS)}")
        missing = sorted(set(np.unique(self.mesh.regions).tolist()) - set(self.shear_kpa))
        if missing:
            raise InputError(f"regions {missing} of the body have no stiffness")

    @cached_property
    def surface(self) -> ContactSurface:
        """Its outside."""
        return ContactSurface.of(self.mesh)

    @cached_property
    def space(self) -> Space:
        """Its unknowns."""
        return Space.of(self.mesh, ELEMENT)

    @cached_property
    def radius(self) -> float:
        """Of the ball of the same volume, mm."""
        return float((0.75 * self.mesh.volumes.sum() / np.pi) ** (1.0 / 3.0))

    @cached_property
    def contact_stiffness(self) -> FloatArray:
        """(f,) kPa/mm."""
        s = self.surface
        behind = np.array([self.shear_kpa[int(r)] for r in self.mesh.regions[s.owner]])
        return np.asarray(_CONTACT * behind / s.face_edge)

    def press(self, centre: FloatArray, radius: float, start: FloatArray) -> Press:
        """A probe that presses, its centre at (3,) mm, having come from `start`."""
        return Press(
            self.surface, centre, radius, self.contact_stiffness, _DEEPEST / _CONTACT * self.surface.face_edge, start
        )

    def grip(self, point: FloatArray, reach: float, move: FloatArray) -> Grip:
        """A probe that sticks to what lies within `reach` of a point (3,) mm of the surface, and has moved by `move`
        (3,) mm.
        """
        return Grip.at(self.surface, point, reach, move, self.contact_stiffness)

    @property
    def materials(self) -> dict[int, Material]:
        """Mooney-Rivlin with mu1 = mu2, as the identification has it."""
        nu = self.poisson_ratio
        return {
            r: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(G, bulk_modulus(G, nu), 0.5))
            for r, G in self.shear_kpa.items()
        }

    def region_of(self, face: int) -> int:
        """Region behind a face of the surface."""
        return int(self.mesh.regions[self.surface.owner[face]])

    def assembler(self, *terms: Term, solver: str = "auto") -> Assembler:
        """Of the body with its support and further terms, materials set."""
        free = np.ones((self.space.n_nodes, 3), dtype=bool)
        for held in (self._table(), self.fixed):
            if held is not None:
                free[held] = False
        assembler = Assembler(self.space, free.ravel(), [*self._bed(), *terms], solver)
        assembler.set_materials(self.materials)
        return assembler

    def _table(self) -> IntArray | None:
        if self.support != "table":
            return None
        behind = self.surface.rest[:, 1]  # LPS: y grows towards the back
        return self.surface.nodes[behind > behind.max() - _TABLE * np.ptp(behind)]

    def _bed(self) -> list[Springs]:
        """Springs of 3 G / (2 R) per area: with them a ball moves under a force as in endless incompressible tissue.

        A rigid ball's drag there is spread evenly over its surface (Stokes' solution, F = 6 pi G R u, read as
        elasticity).
        """
        if self.support != "bed":
            return []
        s = self.surface
        points = PointSet(s.nodes[:, None], np.ones((len(s.nodes), 1)), s.node_area)
        stiffness = 1.5 * self.tissue_kpa / self.radius * np.eye(3)
        return [Springs(points, stiffness, np.zeros((len(s.nodes), 3)))]
