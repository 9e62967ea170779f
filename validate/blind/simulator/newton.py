"""A simulated body in equilibrium: Newton with load steps, and what its moduli change."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import ConvergenceError
from palpate.validate.blind.simulator.fem import Body, Laws

_TOLERANCE, _ITERATIONS, _SMALLEST_STEP = 1e-7, 14, 1.0 / 64.0
# So many goes, and a body that creeps on by small steps folds all the same: soft layers took minutes to do so.
_GOES = 12
# Of the bulk moduli, the share with which a body begins that gets to a growth it is not stable under at once: soft in volume it takes the
# new volume, and holds it as it stiffens, by this factor at a time or by less.
_SOFT, _STIFFER, _LEAST = 0.03, 3.5, 1.08
# A step of Newton's longer than this leads nowhere, mm.
_ABSURD_MM = 60.0
# Newton is given up when this many steps have not halved what is out of balance.
_PATIENCE = 4


def equilibrium(
    body: Body, laws: Laws, held: FloatArray, load: FloatArray | None = None, start: FloatArray | None = None
) -> FloatArray:
    """Displacement (n, 3) mm in equilibrium; held : (n, 3) mm where prescribed, NaN where free. load : (n, 3) mN, dead.

    From `start` or from rest, boundary, load and growth going as far at a time as Newton follows. Raises ConvergenceError when there
    is none.
    """
    free = np.isnan(held).ravel()
    force = np.zeros(held.size) if load is None else load.ravel()
    if start is not None and has_grown(laws):
        return _softened(body, laws, start.ravel(), force, held).reshape(-1, 3)
    u = np.zeros(held.size) if start is None else start.ravel().copy()
    # Tissue that has grown all at once is under more pressure than it is stable under.
    begin, reached, step = u.copy(), 0.0, 0.25 if has_grown(laws) else 1.0
    for _ in range(_GOES):
        way = min(reached + step, 1.0)
        target = np.where(free, u, begin + way * (np.nan_to_num(held.ravel()) - begin))
        here = {region: law.eased(way) for region, law in laws.items()} if start is None else laws
        found = _newton(body, here, u, target - u, way * force if start is None else force, free)
        if found is not None:
            u, reached, step = found, way, 1.5 * step
            if reached == 1.0:
                return u.reshape(-1, 3)
            continue
        step *= 0.5
        if step < _SMALLEST_STEP or start is not None:
            break
    raise ConvergenceError("the simulated body has no equilibrium; make its walls move less")


def has_grown(laws: Laws) -> bool:
    """Whether any of it has."""
    return any(bool((law.growth != 1.0).any()) for law in laws.values())


def _softened(body: Body, laws: Laws, start: FloatArray, force: FloatArray, held: FloatArray) -> FloatArray:
    """Equilibrium (3 n,) from one like it but for the growth, by way of softer bulk moduli. Raises ConvergenceError."""
    free = np.isnan(held).ravel()
    u, reached, factor = start, _SOFT / _STIFFER, _STIFFER
    for _ in range(_GOES):
        share = min(reached * factor, 1.0)
        jump = np.where(free, 0.0, np.nan_to_num(held.ravel()) - u)
        found = _newton(body, {region: law.softer(share) for region, law in laws.items()}, u, jump, force, free)
        if found is None:
            factor = np.sqrt(factor)
            if factor < _LEAST:
                break
            continue
        u, reached = found, share
        if reached == 1.0:
            return u
    raise ConvergenceError("the simulated body has no equilibrium with what has grown in it; make its walls move less")


def _newton(
    body: Body, laws: Laws, u: FloatArray, jump: FloatArray, force: FloatArray, free: BoolArray
) -> FloatArray | None:
    """Newton's method with the held unknowns moved by `jump` in the first step; None when it does not converge."""
    inner, K = body.assemble(u.reshape(-1, 3), laws)
    if not np.isfinite(inner).all():
        return None
    first, lefts = None, [np.inf]
    for k in range(_ITERATIONS):
        rhs = force - inner - (K @ jump if k == 0 else 0.0)
        move = jump.copy() if k == 0 else np.zeros_like(u)
        move[free] = body.solver(K, free).solve(K, rhs[free])
        u, inner, K = _as_far_as_allowed(body, laws, u, move, whole=k == 0 and bool(jump.any()))
        left = float(np.linalg.norm((force - inner)[free]))
        if not np.isfinite(left) or np.abs(move).max() > _ABSURD_MM:
            return None
        first = float(np.linalg.norm(inner[~free])) if first is None else first
        if left < _TOLERANCE * max(first, 1e-9):
            return u
        lefts.append(left)
        if k >= _PATIENCE and left > 0.5 * min(lefts[:-_PATIENCE]):
            return None
    return None


def _as_far_as_allowed(
    body: Body, laws: Laws, u: FloatArray, move: FloatArray, whole: bool
) -> tuple[FloatArray, FloatArray, sparse.csr_matrix]:
    """Go the whole way, or (but in the first step, which holds the boundary's motion) half of it while a cell turns inside out."""
    share = 1.0
    while True:
        there = u + share * move
        inner, K = body.assemble(there.reshape(-1, 3), laws)
        if np.isfinite(inner).all() or whole or share < 0.1:
            return there, inner, K
        share *= 0.5


def slopes_in(body: Body, laws: Laws, regions: Sequence[int], u: FloatArray, held: FloatArray) -> list[FloatArray]:
    """For each region (n, 3) mm, derivative of the equilibrium u in the logarithm of all moduli of that region."""
    free = np.isnan(held).ravel()
    K = body.assemble(u, laws)[1]
    # Stress is proportional to the moduli, so their logarithm's derivative is the region's own force.
    own = np.stack([body.assemble(u, {region: laws[region]})[0] for region in regions], axis=1)
    moved = np.zeros((u.size, len(regions)))
    moved[free] = -body.solver(K, free).solve(K, own[free])
    return [column.reshape(-1, 3) for column in moved.T]
