"""What the blind check hides of the library's twelve effects, none written as the diagnosis has it.

A focus has a sharp edge, sliding is a soft layer, a load is pressure on a patch, prestress is a body whose rest scan is itself deformed.
"""

from __future__ import annotations

import numpy as np

from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.imaging.labels import ORGAN_LABELS
from palpate.validate.blind.simulator.draws import ball, direction, either, sign
from palpate.validate.blind.simulator.patients import Rigid
from palpate.validate.blind.simulator.simulated_body import Hide, Simulated

# Weight of 1000 kg/m3, kPa/mm for each m/s2.
_WEIGHT = 1e-3
_LAYER_MM = 3.0


def _sliding(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """A layer of tissue around the organ `size` times softer in shear."""
    surface = TriangleTree.of(s.body.points, s.organ_faces)
    near = np.abs(closest_points(surface, s.centres).signed) < _LAYER_MM
    s.G = np.where(near & ~s.in_organ, s.G / size, s.G)


def _inclusion(s: Simulated, size: float, rng: np.random.Generator) -> None:
    inside, s.centre = ball(s, rng, int(rng.choice(ORGAN_LABELS)))
    s.stiffer(inside, either(size, rng))


def _fibres(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """size : extra Young's modulus along the fibres over 3 G."""
    s.directions |= dict.fromkeys(ORGAN_LABELS, direction(rng))
    s.fibre = np.where(s.in_organ, 0.75 * size * s.G, s.fibre)


def _volume(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """size : of the volume, gained or lost."""
    s.growth = np.where(s.in_organ, (1.0 + sign(rng) * size) ** (1.0 / 3.0), s.growth)


def _compressible(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """size : G / K of the organ beyond what the plain model has."""
    s.K = np.where(s.in_organ, 1.0 / (1.0 / s.K + size / s.G), s.K)


def _stiffening(s: Simulated, size: float, rng: np.random.Generator) -> None:
    s.stiffening = size


def _one_side(s: Simulated, size: float, rng: np.random.Generator) -> None:
    axis = np.array([(0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)][rng.integers(4)])
    beyond = (s.centres - s.middle) @ axis > rng.uniform(-3.0, 6.0)
    s.stiffer(beyond & ~s.in_organ, either(size, rng))


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
    """size : kPa at the middle of a patch of the organ's surface, inwards: what is unseen pushes; scars and tears pull."""
    X = s.body.points[s.organ_faces]
    area = 0.5 * np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
    at = X.mean(axis=1)
    s.centre = at[np.argmax((at - s.middle) @ np.array(direction(rng)))]
    share = np.clip(1.0 - (np.linalg.norm(at - s.centre, axis=1) / 12.0) ** 2, 0.0, None)
    s.pull_at_surface(-size * share[:, None] * area)


def _bias(s: Simulated, size: float, rng: np.random.Generator) -> None:
    wider = sign(rng) * size
    s.offset = lambda normals: np.full(len(normals), wider)


LIBRARY: dict[str, Hide] = {
    "interface_sliding": _sliding, "inclusion": _inclusion, "fibre_anisotropy": _fibres, "volume_change": _volume,
    "compressible_organ": _compressible, "tissue_stiffening": _stiffening, "tissue_heterogeneity": _one_side, "bone_motion": _bones,
    "gravity_change": _gravity, "prestress": _prestress, "unmodelled_load": _push, "contour_bias": _bias,
}  # fmt: skip
