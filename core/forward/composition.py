"""What a model is made of, as one value: problem, law, kinematics, interface, support, load, geometry, observation.

The plain model has nothing in any part but the problem. An effect puts something into one part (or several) and leaves the
others alone, so effects add up in any order of their parts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.materials import Material
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term
from palpate.core.mesh import TetMesh
from palpate.core.problem import IdentificationProblem
from palpate.core.surfaces.rigid_motion import Motion

# (mesh, region -> material) -> region -> material. Must not depend on values in any but a smooth way.
MaterialChange = Callable[[TetMesh, Mapping[int, Material]], dict[int, Material]]
# A load on a space: body force, traction.
LoadPart = Callable[[Space], Term]


@dataclass(frozen=True, eq=False)
class Composition:
    """One model.

    law, kinematics : changes of the materials, in that order. interface : tangential compliance between organ and tissue,
    mm/kPa (0: tied). support : motions of bone. edge_mm : how far from bone the region's edge goes along with it, 0 where it does
    not. load : dead loads. geometry : (points, 3) mm from the scanned rest mesh to the stress-free one, None for none. observation :
    mm by which the deformed scan shows the organ too wide. state : which of the case's deformed states this is, from 0.
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

    def with_law(self, change: MaterialChange) -> Composition:
        """With one more change of the materials' laws."""
        return replace(self, law=(*self.law, change))

    def with_kinematics(self, change: MaterialChange) -> Composition:
        """With one more change of what strain is measured from."""
        return replace(self, kinematics=(*self.kinematics, change))

    def with_interface(self, compliance: float) -> Composition:
        """With more tangential compliance (mm/kPa) between organ and tissue."""
        return replace(self, interface=self.interface + compliance)

    def with_support(self, motion: Motion, edge_mm: float = 0.0) -> Composition:
        """With one more motion of the bones, which draws the region's edge along over about edge_mm."""
        return replace(self, support=(*self.support, motion), edge_mm=max(self.edge_mm, edge_mm))

    def with_load(self, load: LoadPart) -> Composition:
        """With one more dead load."""
        return replace(self, load=(*self.load, load))

    def with_geometry(self, shift: FloatArray) -> Composition:
        """With the stress-free mesh moved by shift (points, 3) mm more."""
        return replace(self, geometry=shift if self.geometry is None else self.geometry + shift)

    def with_observation(self, offset_mm: float) -> Composition:
        """With the deformed contour wider by offset_mm more."""
        return replace(self, observation=self.observation + offset_mm)

    def materials(self, plain: Mapping[int, Material]) -> dict[int, Material]:
        """The materials (region -> Material) that the plain ones become."""
        out = dict(plain)
        for change in (*self.law, *self.kinematics):
            out = change(self.problem.mesh, out)
        return out

    def bone_motion(self, X: FloatArray) -> FloatArray:
        """(n, 3) mm, displacement of bone at X (n, 3)."""
        out = np.zeros_like(X)
        for motion in self.support:
            out = out + motion(X)
        return out
