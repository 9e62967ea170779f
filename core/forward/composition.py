"""Composition of a model as one value: problem, law, kinematics, interface, support, load, geometry, observation.

The plain model has nothing in any part but the problem. An effect adds to one part or several and leaves the others
alone, so that effects in different parts commute.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.materials import Material
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term
from palpate.core.mesh import TetMesh
from palpate.core.problem import IdentificationProblem
from palpate.core.surfaces.rigid_motion import Motion

# (mesh, region -> material) -> region -> material. Postcondition: the values depend smoothly on those given.
MaterialChange = Callable[[TetMesh, Mapping[int, Material]], dict[int, Material]]
# A load on a space: body force, traction.
LoadPart = Callable[[Space], Term]
# A value for each axis; None where there is none.
PerAxis = tuple[float | None, float | None, float | None]


@dataclass(frozen=True, eq=False)
class Patch:
    """Part of the boundary, faces (f, 3), that is held or moved as a whole: its displacement, mm; None along an axis
    where it is free."""

    faces: IntArray
    displacement: PerAxis

    @property
    def axes(self) -> IntArray:
        """Axes along which it is not free."""
        return np.flatnonzero([value is not None for value in self.displacement])


@dataclass(frozen=True, eq=False)
class Composition:
    """Parts of one model.

    law, kinematics : changes of the materials, in that order. interface : tangential compliance between organ and
    tissue, mm/kPa (0: tied). support : motions of bone. edge_mm : how far from bone the region's edge goes along with
    it, 0 where it does not. load : dead loads. geometry : (points, 3) mm from the scanned rest mesh to the stress-free
    one, None for none. observation : mm by which the deformed scan shows the organ too wide. state : which of the
    case's deformed states this is, from 0. patches : of a body on a bench, what holds and moves it beside its bones.
    on_bench : whether known loads and patches deform the body, so that it needs no walls.
    """

    problem: IdentificationProblem
    law: tuple[MaterialChange, ...] = ()
    kinematics: tuple[MaterialChange, ...] = ()
    interface: float = 0.0
    support: tuple[Motion, ...] = ()
    edge_mm: float = 0.0
    load: tuple[LoadPart, ...] = ()
    geometry: FloatArray | None = None
    observation: float = 0.0
    state: int = 0
    patches: tuple[Patch, ...] = ()
    on_bench: bool = False

    def with_law(self, change: MaterialChange) -> Composition:
        """The same with one more change of the materials' laws."""
        return replace(self, law=(*self.law, change))

    def with_kinematics(self, change: MaterialChange) -> Composition:
        """The same with one more change of the state that strain is measured from."""
        return replace(self, kinematics=(*self.kinematics, change))

    def with_interface(self, compliance: float) -> Composition:
        """The same with more tangential compliance (mm/kPa) between organ and tissue."""
        return replace(self, interface=self.interface + compliance)

    def with_support(self, motion: Motion, edge_mm: float = 0.0) -> Composition:
        """The same with one more motion of the bones; the region's edge follows it within about edge_mm of bone."""
        return replace(self, support=(*self.support, motion), edge_mm=max(self.edge_mm, edge_mm))

    def with_load(self, load: LoadPart) -> Composition:
        """The same with one more dead load."""
        return replace(self, load=(*self.load, load))

    def with_geometry(self, shift: FloatArray) -> Composition:
        """The same with the points of the stress-free mesh moved by shift (points, 3) mm more."""
        return replace(self, geometry=shift if self.geometry is None else self.geometry + shift)

    def with_observation(self, offset_mm: float) -> Composition:
        """The same with the deformed contour wider by offset_mm more."""
        return replace(self, observation=self.observation + offset_mm)

    def materials(self, plain: Mapping[int, Material]) -> dict[int, Material]:
        """Materials (region -> Material) after all changes of law and kinematics, in that order."""
        out = dict(plain)
        for change in (*self.law, *self.kinematics):
            out = change(self.problem.mesh, out)
        return out

    def bone_motion(self, X: FloatArray) -> FloatArray:
        """Displacement (n, 3) mm of bone at X (n, 3) mm: the sum of all motions."""
        out = np.zeros_like(X)
        for motion in self.support:
            out = out + motion(X)
        return out
