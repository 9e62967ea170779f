"""What the blind check hides: twelve effects of the library and six beside it, each a change of a simulated body.

None is written as the diagnosis has it: a focus has a sharp edge, sliding is a soft layer, a load is pressure on a patch, prestress is a
body whose rest scan is itself deformed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from palpate.segmentation.gap_truth.anatomy import Rigid
from palpate.segmentation.gap_truth.body import Body, Laws
from palpate.segmentation.gap_truth.laws import Organ, Tissue
from palpate.segmentation.labels import ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.segmentation.smooth_field import FloatArray, IntArray

TISSUE_G, TISSUE_NU, ORGAN_NU = 20.0, 0.49, 0.495
# Weight of 1000 kg/m3, kPa/mm for each m/s2.
_WEIGHT = 1e-6
_LAYER_MM = 3.0


@dataclass(eq=False)
class Simulated:
    """A body and all that is done to it; the plain one until an effect changes it.

    organ_faces : (f, 3) of its outer surface, normals outwards. G, K, growth, fibre : (m,) of every cell. load : (n, 3) mN on nodes
    in the deformed state. bone : its motion. filled : share of the walls' extra filling already there in the scan at rest, by
    wall. offset : normals (k, 3) -> mm by which the deformed contour is too wide. centre : where the effect is, if anywhere.
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
    def in_organ(self) -> NDArray[np.bool_]:
        """(m,) whether a cell is the organ's."""
        return np.isin(self.body.regions, ORGAN_LABELS)

    @property
    def middle(self) -> FloatArray:
        """(3,) mm, the organ's centre."""
        return np.asarray(self.body.points[np.unique(self.organ_faces)].mean(axis=0))

    def stiffer(self, where: NDArray[np.bool_], factor: float) -> None:
        """Shear and bulk modulus of cells (m,) of bool times a factor."""
        self.G = np.where(where, factor * self.G, self.G)
        self.K = np.where(where, factor * self.K, self.K)

    def pull(self, force: FloatArray) -> None:
        """More force (n, 3) mN in the deformed state."""
        self.load = force if self.load is None else self.load + force


Hide = Callable[[Simulated, float, np.random.Generator], None]


def _either(size: float, rng: np.random.Generator) -> float:
    """size or its inverse."""
    return float(size if rng.random() < 0.6 else 1.0 / size)


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _sliding(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """A layer of tissue around the organ `size` times softer in shear."""
    near = cKDTree(s.body.points[s.organ_faces].mean(axis=1)).query(s.centres)[0] < _LAYER_MM
    s.G = np.where(near & ~s.in_organ, s.G / size, s.G)


def _ball(s: Simulated, rng: np.random.Generator, label: int) -> tuple[NDArray[np.bool_], FloatArray]:
    """A place in one half: cells (m,) of bool within a sharp edge, and its centre."""
    centre = s.centres[s.body.regions == label].mean(axis=0) + rng.uniform(-4.0, 4.0, 3)
    inside = np.linalg.norm(s.centres - centre, axis=1) < rng.uniform(6.5, 9.5)
    return inside & (s.body.regions == label), centre


def _inclusion(s: Simulated, size: float, rng: np.random.Generator) -> None:
    inside, s.centre = _ball(s, rng, int(rng.choice(ORGAN_LABELS)))
    s.stiffer(inside, _either(size, rng))


def _fibres(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """size : extra Young's modulus along the fibres over 3 G."""
    a = rng.standard_normal(3)
    a /= np.linalg.norm(a)
    s.directions |= {label: (float(a[0]), float(a[1]), float(a[2])) for label in ORGAN_LABELS}
    s.fibre = np.where(s.in_organ, 0.75 * size * s.G, s.fibre)


def _volume(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """size : of the volume, gained or lost."""
    s.growth = np.where(s.in_organ, (1.0 + _sign(rng) * size) ** (1.0 / 3.0), s.growth)


def _compressible(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """size : G / K of the organ beyond what the plain model has."""
    s.K = np.where(s.in_organ, 1.0 / (1.0 / s.K + size / s.G), s.K)


def _stiffening(s: Simulated, size: float, rng: np.random.Generator) -> None:
    s.stiffening = size


def _one_side(s: Simulated, size: float, rng: np.random.Generator) -> None:
    axis = np.array([(0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)][rng.integers(4)])
    beyond = (s.centres - s.middle) @ axis > rng.uniform(-3.0, 6.0)
    s.stiffer(beyond & ~s.in_organ, _either(size, rng))


def _bones(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """size : mm, and about as many degrees."""
    shift, turn = rng.standard_normal(3), rng.standard_normal(3)
    shift, turn = size * shift / np.linalg.norm(shift), np.deg2rad(size) * turn / np.linalg.norm(turn)
    s.bone = Rigid(shift, turn, s.middle)


def _gravity(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """From supine to prone, `size` times what 1000 kg/m3 weighs."""
    change = 2.0 * 9.81 * size * _WEIGHT
    force = np.zeros((len(s.body.nodes), 3))
    for a in range(10):
        shape = np.broadcast_to(np.asarray(s.body.basis.basis[a][0]), s.body.weights.shape)
        np.add.at(force[:, 1], s.body.cell_nodes[:, a], -change * (shape * s.body.weights).sum(axis=1))
    s.pull(force)


def _prestress(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """size : share of the walls' motion that is already there at rest, of one wall inwards."""
    s.filled = (
        {"rectum": size, "bladder": -0.6 * size} if rng.random() < 0.5 else {"rectum": -0.6 * size, "bladder": size}
    )


def _push(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """size : kPa at the middle of a patch of the organ's surface, inwards or outwards."""
    X = s.body.points[s.organ_faces]
    area = 0.5 * np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
    at = X.mean(axis=1)
    s.centre = at[rng.integers(len(at))]
    share = np.clip(1.0 - (np.linalg.norm(at - s.centre, axis=1) / 12.0) ** 2, 0.0, None)
    force = -_sign(rng) * size * share[:, None] * area
    load = np.zeros((len(s.body.nodes), 3))
    # A constant pressure on a quadratic triangle is carried by its mid-edges, a third each.
    for column in s.body.face_nodes(s.organ_faces)[:, 3:].T:
        np.add.at(load, column, force / 3.0)
    s.pull(load)


def _bias(s: Simulated, size: float, rng: np.random.Generator) -> None:
    sign = _sign(rng)
    s.offset = lambda normals: np.full(len(normals), sign * size)


def _uneven_growth(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """One half swells and the other shrinks."""
    for label, sign in zip(rng.permutation(ORGAN_LABELS).tolist(), (1.0, -1.0), strict=True):
        s.growth = np.where(s.body.regions == label, (1.0 + sign * size) ** (1.0 / 3.0), s.growth)


def _two_foci(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """One stiff, one soft, in the two halves."""
    for label, factor in zip(rng.permutation(ORGAN_LABELS).tolist(), (size, 1.0 / size), strict=True):
        s.stiffer(_ball(s, rng, int(label))[0], factor)


def _tear(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """A cleft in the tissue beside the organ, `size` times softer."""
    side = np.array([_sign(rng), 0.0, 0.0])
    X = s.body.points[np.unique(s.organ_faces)]
    reach = float(((X - s.middle) @ side).max())
    away = (s.centres - s.middle) @ side
    across = np.linalg.norm((s.centres - s.middle)[:, 1:], axis=1)
    s.stiffer((away > 0.5 * reach) & (away < reach + 9.0) & (across < 22.0) & ~s.in_organ, 1.0 / size)


def _shrunken_tissue(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """A scar: tissue in a ball beside the organ has shrunk."""
    X = s.body.points[np.unique(s.organ_faces)]
    s.centre = X[rng.integers(len(X))]
    inside = np.linalg.norm(s.centres - s.centre, axis=1) < 14.0
    s.growth = np.where(inside & ~s.in_organ, 1.0 - size, s.growth)


def _tissue_fibres(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """The tissue, not the organ, is stiffer along one direction."""
    a = rng.standard_normal(3)
    a /= np.linalg.norm(a)
    s.directions[SURROUNDING_TISSUE] = (float(a[0]), float(a[1]), float(a[2]))
    s.fibre = np.where(s.in_organ, s.fibre, 3.0 * size * s.G)


def _one_sided_contour(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """The contour is too wide on one side alone."""
    a = rng.standard_normal(3)
    a /= np.linalg.norm(a)
    s.offset = lambda normals: size * np.clip(normals @ a, 0.0, None) ** 2


LIBRARY: dict[str, Hide] = {
    "interface_sliding": _sliding, "inclusion": _inclusion, "fibre_anisotropy": _fibres, "volume_change": _volume,
    "compressible_organ": _compressible, "tissue_stiffening": _stiffening, "tissue_heterogeneity": _one_side, "bone_motion": _bones,
    "gravity_change": _gravity, "prestress": _prestress, "unmodelled_load": _push, "contour_bias": _bias,
}  # fmt: skip
OUTSIDE: dict[str, Hide] = {
    "uneven_growth": _uneven_growth, "two_foci": _two_foci, "tissue_tear": _tear, "shrunken_tissue": _shrunken_tissue,
    "tissue_fibres": _tissue_fibres, "one_sided_contour": _one_sided_contour,
}  # fmt: skip
# Strength of each from weak to strong: about one to ten times the contours' noise where surfaces show it at all.
SIZES: dict[str, tuple[float, float]] = {
    "interface_sliding": (8.0, 80.0), "inclusion": (4.0, 25.0), "fibre_anisotropy": (2.0, 8.0), "volume_change": (0.06, 0.25),
    "compressible_organ": (0.15, 0.6), "tissue_stiffening": (5.0, 40.0), "tissue_heterogeneity": (3.0, 12.0),
    "bone_motion": (1.0, 5.0), "gravity_change": (1.0, 2.0), "prestress": (0.25, 0.7), "unmodelled_load": (4.0, 20.0),
    "contour_bias": (0.4, 1.8), "uneven_growth": (0.1, 0.35), "two_foci": (6.0, 30.0), "tissue_tear": (10.0, 50.0),
    "shrunken_tissue": (0.08, 0.25), "tissue_fibres": (2.0, 8.0), "one_sided_contour": (1.0, 3.5),
}  # fmt: skip
