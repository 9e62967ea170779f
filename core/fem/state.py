"""State of a body, and its distance from equilibrium."""

from __future__ import annotations

from dataclasses import dataclass

from palpate.core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class State:
    """Displacements u (n, 3) mm and pressures p (n_p,) kPa.

    q : (m, points) kPa, elements without pressure unknowns only: pressures at the quadrature points, iterated with u
    towards kappa g; None where they equal kappa g.
    """

    u: FloatArray
    p: FloatArray
    q: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Residual:
    """Out-of-balance: r_u (3 n,) mN, r_p (n_p,) mm3, the forces' magnitude (mN), smallest det F of guarded cells.

    lag : (m, points) kappa g - q of a state with q; then r_u is that of q + lag G0 / G, the right-hand side of the
    system from which the points' pressures were eliminated with the slopes G0 of the present factor.
    """

    r_u: FloatArray
    r_p: FloatArray
    scale: float
    min_jacobian: float
    lag: FloatArray | None = None
