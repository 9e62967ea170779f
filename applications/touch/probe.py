"""The rigid spherical probe: pressed against a surface without friction, or stuck to it to pull. Terms of the energy.

Both have one block a face, so that one assembler serves for every place of the probe.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.applications.touch.contact_kernel import POINTS, WEIGHTS, sphere_blocks
from palpate.applications.touch.surface import ContactSurface
from palpate.core.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Blocks:
    """Of some faces r of the surface: energy mN mm, gradient (r, 9) mN, hessian (r, 9, 9) mN/mm or (0, 9, 9)."""

    energy: float
    gradient: FloatArray
    hessian: FloatArray

    @property
    def force(self) -> FloatArray:
        """(3,) mN that the surface exerts on the probe: what it does to the surface, turned round."""
        return np.asarray(self.gradient.reshape(-1, 3, 3).sum(axis=(0, 1)))


@dataclass(frozen=True, eq=False)
class Press:
    """A sphere that presses: what is inside is pushed out by a pressure of `stiffness` (f,) kPa/mm times its depth.

    centre : (3,) mm. start : (3,) mm, where the sphere is at load 0. deepest : see `contact_kernel`.
    """

    surface: ContactSurface
    centre: FloatArray
    radius: float
    stiffness: FloatArray
    deepest: FloatArray
    start: FloatArray

    @property
    def unknowns(self) -> IntArray:
        """See `Term.unknowns`."""
        return self.surface.unknowns

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """See `Term.evaluate`."""
        centre = self.start + load * (self.centre - self.start)
        contact = self.blocks(np.arange(len(self.surface.faces)), u[self.surface.nodes], order, centre)
        return contact.energy, contact.gradient, contact.hessian

    def blocks(self, rows: IntArray, u: FloatArray, order: int, centre: FloatArray | None = None) -> Blocks:
        """Of the faces `rows`; u (s, 3) mm displacements of the surface's nodes."""
        s = self.surface
        energy, gradient = np.empty(len(rows)), np.empty((len(rows), 9))
        hessian = np.empty((len(rows) if order >= 2 else 0, 9, 9))
        sphere_blocks(
            rows, s.local_faces, s.face_area, s.rest + u, self.centre if centre is None else centre, self.radius,
            self.stiffness, self.deepest, POINTS, WEIGHTS, energy, gradient, hessian,
        )  # fmt: skip
        return Blocks(float(energy.sum()), gradient, hessian)

    def near(self, u: FloatArray, margin: float) -> IntArray:
        """Faces that are, or within `margin` mm might come to be, in contact."""
        away = np.linalg.norm(self.surface.rest + u - self.centre, axis=1)
        reach = self.radius + 0.6 * self.surface.longest_edge + margin
        return np.flatnonzero((away[self.surface.local_faces] < reach).any(axis=1))


@dataclass(frozen=True, eq=False)
class Grip:
    """A patch of the surface stuck to the probe, as by suction, and moved with it.

    weight : (f, 3) share of each face's area at its corners that sticks. move : (3,) mm. stiffness : (f,) kPa/mm.
    """

    surface: ContactSurface
    weight: FloatArray
    move: FloatArray
    stiffness: FloatArray

    @classmethod
    def at(
        cls, surface: ContactSurface, point: FloatArray, reach: float, move: FloatArray, stiffness: FloatArray
    ) -> Grip:
        """All within `reach` mm of a point (3,) sticks, less towards the edge so that the patch may lie anywhere."""
        away = np.linalg.norm(surface.rest - point, axis=1)
        width = max(reach, surface.edge)
        stuck = np.maximum(0.0, 1.0 - (away / width) ** 2)
        return cls(surface, stuck[surface.local_faces], move, stiffness)

    @property
    def unknowns(self) -> IntArray:
        """See `Term.unknowns`."""
        return self.surface.unknowns

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """See `Term.evaluate`."""
        contact = self.blocks(np.arange(len(self.surface.faces)), u[self.surface.nodes], order, load)
        return contact.energy, contact.gradient, contact.hessian

    def blocks(self, rows: IntArray, u: FloatArray, order: int, load: float = 1.0) -> Blocks:
        """See `Press.blocks`."""
        s = self.surface
        stiffness = (self.stiffness * s.face_area)[rows, None] / 3.0 * self.weight[rows]
        away = u[s.local_faces[rows]] - load * self.move
        gradient = stiffness[:, :, None] * away
        hessian = np.zeros((len(rows) if order >= 2 else 0, 9, 9))
        if order >= 2:
            hessian[:, np.arange(9), np.arange(9)] = np.repeat(stiffness, 3, axis=1)
        return Blocks(0.5 * float((gradient * away).sum()), gradient.reshape(-1, 9), hessian)

    def near(self, u: FloatArray, margin: float) -> IntArray:
        """Faces that stick."""
        return np.flatnonzero(self.weight.any(axis=1))


Contact = Press | Grip
