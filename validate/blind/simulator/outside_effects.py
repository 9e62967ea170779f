"""Six effects beside the library, for which the diagnosis has no name."""

from __future__ import annotations

import numpy as np

from palpate.imaging.labels import ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.validate.blind.simulator.draws import ball, direction, sign
from palpate.validate.blind.simulator.simulated_body import Hide, Simulated


def _uneven_growth(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """One half swells and the other shrinks."""
    for label, way in zip(rng.permutation(ORGAN_LABELS).tolist(), (1.0, -1.0), strict=True):
        s.growth = np.where(s.body.regions == label, (1.0 + way * size) ** (1.0 / 3.0), s.growth)


def _two_foci(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """One stiff, one soft, in the two halves."""
    for label, factor in zip(rng.permutation(ORGAN_LABELS).tolist(), (size, 1.0 / size), strict=True):
        s.stiffer(ball(s, rng, int(label))[0], factor)


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


def _one_sided_contour(s: Simulated, size: float, rng: np.random.Generator) -> None:
    """The contour is too wide on one side alone."""
    a = np.array(direction(rng))
    s.offset = lambda normals: size * np.clip(normals @ a, 0.0, None) ** 2


OUTSIDE: dict[str, Hide] = {
    "uneven_growth": _uneven_growth, "two_foci": _two_foci, "tissue_tear": _tear, "shrunken_tissue": _shrunken_tissue,
    "tissue_fibres": _tissue_fibres, "one_sided_contour": _one_sided_contour,
}  # fmt: skip
