"""State of motion of a body, and its energy."""

from __future__ import annotations

from dataclasses import dataclass

from palpate.core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Motion:
    """time s; u (n, 3) mm displacements from rest; v (n, 3) mm/s."""

    time: float
    u: FloatArray
    v: FloatArray


@dataclass(frozen=True)
class Energies:
    """mN mm (1e-6 J). elastic includes the assembler's terms; gravity is zero at rest; contact is the layer's before a
    wall.
    """

    kinetic: float
    elastic: float
    gravity: float
    contact: float

    @property
    def total(self) -> float:
        """The mechanical energy."""
        return self.kinetic + self.elastic + self.gravity + self.contact


@dataclass(frozen=True, eq=False)
class Stage:
    """One implicit stage of a step: U = base + h V with M (V - velocity) = h force(U, V).

    h : s. base (n, 3) mm, velocity (n, 3) mm/s. load : of the assembler's terms. damping : (nnz,) upper triangle of the
    damping matrix, or nothing. friction_from : (n, 3) mm displacements at which friction's normal force and directions
    are taken, None without friction.
    """

    h: float
    base: FloatArray
    velocity: FloatArray
    load: float
    damping: FloatArray | None
    friction_from: FloatArray | None

    @property
    def aim(self) -> FloatArray:
        """Displacements (n, 3) mm at the end of the stage without forces."""
        return self.base + self.h * self.velocity
