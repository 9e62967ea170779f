"""Eight effects beside the library, for which the diagnosis has no name; hardly any is a relative of one that has."""

from __future__ import annotations

import numpy as np

from palpate.imaging.labels import SURROUNDING_TISSUE
from palpate.validate.blind.simulator.draws import direction, sign
from palpate.validate.blind.simulator.simulated_body import Hide, Simulated


def _stretched(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """The deformed scan is too long or too short along one axis by `size`: a couch that moves at another pace, a wrong pixel size."""
    axis = np.eye(3)[rng.integers(3)]
    share, middle = sign(rng) * size, s.middle
    s.scan = lambda points: share * ((points - middle) @ axis)[:, None] * axis


def _shifted(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """The patient moved by `size` mm while the deformed scan was taken: slices above a level lie elsewhere."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    way, level = size * np.array([np.cos(angle), np.sin(angle), 0.0]), s.middle[2] + rng.uniform(-6.0, 6.0)
    s.scan = lambda points: way / (1.0 + np.exp(-np.clip((points[:, 2:] - level) / 1.0, -40.0, 40.0)))


def _wall_wide(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """The contour of rectum or bladder in the deformed scan, not the organ's, is too wide or too tight by `size` mm."""
    s.wall_offsets = {str(rng.choice(["rectum", "bladder"])): sign(rng) * size}


def _catheter(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """A catheter along the organ's axis pulls at its inside, up or down: `size` kPa/mm within 4 mm of the axis."""
    near = np.linalg.norm((s.centres - s.middle)[:, :2], axis=1) < 4.0
    cells = np.flatnonzero(near & s.in_organ)
    pull = sign(rng) * size * s.body.weights[cells].sum(axis=1)
    force = np.zeros((len(s.body.nodes), 3))
    # A constant force on a quadratic cell is carried by its mid-edges, less what its corners have.
    for column in range(10):
        np.add.at(force[:, 2], s.body.cell_nodes[cells, column], (0.2 if column >= 4 else -0.05) * pull)
    s.pull(force)


def _twist(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """Something turns the organ about an axis through its middle: `size` kPa along its surface, no push as a whole."""
    axis = np.array(direction(rng))
    X = s.body.points[s.organ_faces]
    area = 0.5 * np.linalg.norm(np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0]), axis=1)
    along = np.cross(axis, X.mean(axis=1) - s.middle)
    s.pull_at_surface(size * area[:, None] * along / np.linalg.norm(along, axis=1).max())


def _tear(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """A cleft in the tissue beside the organ, `size` times softer."""
    side = np.array([sign(rng), 0.0, 0.0])
    X = s.body.points[np.unique(s.organ_faces)]
    reach = float(((X - s.middle) @ side).max())
    away = (s.centres - s.middle) @ side
    across = np.linalg.norm((s.centres - s.middle)[:, 1:], axis=1)
    s.stiffer((away > 0.5 * reach) & (away < reach + 9.0) & (across < 22.0) & ~s.in_organ, 1.0 / size)


def _shrunken_tissue(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """A scar: tissue in a ball beside the organ has shrunk."""
    X = s.body.points[np.unique(s.organ_faces)]
    s.centre = X[np.argmax((X - s.middle) @ np.array(direction(rng)))]
    inside = np.linalg.norm(s.centres - s.centre, axis=1) < 14.0
    s.growth = np.where(inside & ~s.in_organ, 1.0 - size, s.growth)


def _tissue_fibres(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """The tissue, not the organ, is stiffer along one direction."""
    s.directions[SURROUNDING_TISSUE] = direction(rng)
    s.fibre = np.where(s.in_organ, s.fibre, 3.0 * size * s.G)


OUTSIDE: dict[str, Hide] = {
    "scan_stretched": _stretched, "slices_shifted": _shifted, "wall_drawn_wide": _wall_wide, "catheter_pull": _catheter,
    "organ_twist": _twist, "tissue_tear": _tear, "shrunken_tissue": _shrunken_tissue, "tissue_fibres": _tissue_fibres,
}  # fmt: skip
