"""Contours of two states: as label volumes, or as surfaces without voxels from the same contour errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.surfaces.surface import Surface
from palpate.imaging.labels import BONE, ORGAN_LABELS
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import organ_surfaces, wall_surface
from palpate.meshing.partition import HOLE_NAMES
from palpate.validate.simulated.contour_noise import STRUCTURES, ContourErrors
from palpate.validate.simulated.two_states import TwoStates

Inside = Callable[[FloatArray], BoolArray]
# A contour is looked for so far on both sides of where the voxels have it, mm, at this spacing; then the interval is halved so often.
_REACH_MM, _LOOKS, _HALVINGS = 3.0, 13, 9
# How far inside its surface a face is asked for its region, mm.
_DEEP_MM = 0.5


@dataclass(frozen=True, eq=False)
class Drawing:
    """One state as its contours show it."""

    states: TwoStates
    errors: ContourErrors
    state: str

    def volume(self, grid: Volume) -> Volume:
        """Label volume on a grid."""
        return self.errors.on(self.state, self.states.labels(self.state), grid)

    def inside(self, structure: str) -> Inside:
        """Whether points (n, 3) mm lie inside a structure's contour."""
        labels, members = self.states.labels(self.state), STRUCTURES.get(structure, (BONE,))
        field = self.errors.fields.get((self.state, structure), np.zeros_like)
        return lambda points: np.isin(labels(points + field(points)), members)

    def surfaces(self, seen: Volume) -> dict[str, Surface]:
        """Surfaces without voxels, by name. seen : a label volume of this drawing, which says about where they are."""
        organ = organ_surfaces(seen)
        exact = organ.with_points(on_contour(organ.points, organ.point_normals, self.inside("organ")))
        found = {"organ": Surface(exact.points, exact.faces, self._regions(exact))}
        for label, name in HOLE_NAMES.items():
            wall = wall_surface(seen, label)
            if len(wall.faces):
                found[name] = wall.with_points(on_contour(wall.points, wall.point_normals, self.inside(name)))
        return found

    def _regions(self, organ: Surface) -> IntArray:
        field, labels = self.errors.fields[self.state, "organ"], self.states.labels(self.state)
        at = organ.points[organ.faces].mean(axis=1) - _DEEP_MM * organ.face_normals
        asked = labels(at + field(at)).astype(np.int64)
        return np.where(np.isin(asked, ORGAN_LABELS), asked, organ.region)


def on_contour(points: FloatArray, normals: FloatArray, inside: Inside) -> FloatArray:
    """Points (n, 3) mm moved along outward normals onto the contour nearest to them; where there is none within reach, not moved."""
    offsets = np.linspace(-_REACH_MM, _REACH_MM, _LOOKS)
    held = np.stack([inside(points + s * normals) for s in offsets])
    crosses = held[:-1] & ~held[1:]
    middle = 0.5 * (offsets[:-1] + offsets[1:])
    nearest = np.argmin(np.where(crosses, np.abs(middle)[:, None], np.inf), axis=0)
    there = crosses.any(axis=0)
    low, high = offsets[nearest], offsets[nearest + 1]
    for _ in range(_HALVINGS):
        half = 0.5 * (low + high)
        within = inside(points + half[:, None] * normals)
        low, high = np.where(within, half, low), np.where(within, high, half)
    return points + np.where(there, 0.5 * (low + high), 0.0)[:, None] * normals
