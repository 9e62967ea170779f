"""A body of the blind check and all that is done to it before its two scans are drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.imaging.labels import ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.validate.blind.simulator.fem import Body, Laws
from palpate.validate.blind.simulator.laws import Organ, Tissue
from palpate.validate.blind.simulator.patients import Rigid

TISSUE_G, TISSUE_NU, ORGAN_NU = 20.0, 0.49, 0.495


@dataclass(eq=False)
class Simulated:
    """A body and all that is done to it; the plain one until an effect changes it.

    organ_faces : (f, 3) of its outer surface, normals outwards. G, K, growth, fibre : (m,) of every cell. load : (n, 3) mN on nodes
    in the deformed state. bone : its motion. filled : share of the walls' extra filling already there in the scan at rest, by
    wall. offset : normals (k, 3) -> mm by which the deformed contour is too wide. centre : where the effect is, if anywhere.
    scan : points (k, 3) mm -> how far (k, 3) mm from there the deformed scan shows them. wall_offsets : by wall, mm by which its contour in
    the deformed scan is too wide.
    """

    body: Body
    organ_faces: IntArray
    G: FloatArray
    K: FloatArray
    growth: FloatArray
    fibre: FloatArray
    stiffening: float = 0.0
    directions: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    load: FloatArray | None = None
    bone: Rigid | None = None
    filled: dict[str, float] = field(default_factory=dict)
    offset: Callable[[FloatArray], FloatArray] | None = None
    centre: FloatArray | None = None
    scan: Callable[[FloatArray], FloatArray] | None = None
    wall_offsets: dict[str, float] = field(default_factory=dict)

    @classmethod
    def plain(cls, body: Body, organ_faces: IntArray, G: dict[int, float]) -> Simulated:
        """Without an effect; G : kPa of every organ label."""
        shear = np.full(len(body.cells), TISSUE_G)
        nu = np.full(len(body.cells), TISSUE_NU)
        for label, value in G.items():
            shear[body.regions == label], nu[body.regions == label] = value, ORGAN_NU
        bulk = 2.0 * shear * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))
        return cls(body, organ_faces, shear, bulk, np.ones(len(shear)), np.zeros(len(shear)))

    def laws(self) -> Laws:
        """By region."""
        q = self.body.weights.shape[1]
        out: dict[int, Organ | Tissue] = {}
        for region in np.unique(self.body.regions).tolist():
            here = self.body.regions == region
            G, K, growth, fibre = (np.repeat(a[here], q) for a in (self.G, self.K, self.growth, self.fibre))
            direction = self.directions.get(region, (0.0, 0.0, 1.0))
            if region == SURROUNDING_TISSUE:
                out[region] = Tissue(G, K, growth, fibre, self.stiffening, direction)
            else:
                out[region] = Organ(G, K, growth, fibre, direction)
        return out

    @property
    def centres(self) -> FloatArray:
        """(m, 3) mm of cells."""
        return np.asarray(self.body.points[self.body.cells].mean(axis=1))

    @property
    def in_organ(self) -> BoolArray:
        """(m,) whether a cell is the organ's."""
        return np.isin(self.body.regions, ORGAN_LABELS)

    @property
    def middle(self) -> FloatArray:
        """(3,) mm, the organ's centre."""
        return np.asarray(self.body.points[np.unique(self.organ_faces)].mean(axis=0))

    def stiffer(self, where: BoolArray, factor: float) -> None:
        """Shear and bulk modulus of cells (m,) of bool times a factor."""
        self.G = np.where(where, factor * self.G, self.G)
        self.K = np.where(where, factor * self.K, self.K)

    def pull(self, force: FloatArray) -> None:
        """More force (n, 3) mN in the deformed state."""
        self.load = force if self.load is None else self.load + force

    def pull_at_surface(self, force: FloatArray) -> None:
        """The same by force (f, 3) mN on the organ's faces."""
        load = np.zeros((len(self.body.nodes), 3))
        # A constant traction on a quadratic triangle is carried by its mid-edges, a third each.
        for column in self.body.face_nodes(self.organ_faces)[:, 3:].T:
            np.add.at(load, column, force / 3.0)
        self.pull(load)


# Changes a body by an effect of a size, which means what SIZES of `hidden` gives of it.
Hide = Callable[[Simulated, float, np.random.Generator], None]
