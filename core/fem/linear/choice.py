"""Solvers by name, behind one interface (`direct_solver.SymmetricSolver`): direct ones, and an iterative one for large meshes."""

from __future__ import annotations

from palpate.core.fem.linear.direct import make_direct
from palpate.core.fem.linear.direct_solver import FactorisationError, SymmetricSolver
from palpate.core.fem.linear.iterative import Iterative
from palpate.core.fem.linear.pattern import Pattern
from palpate.core.fem.linear.two_level import Levels

__all__ = ["FactorisationError", "Iterative", "Levels", "SymmetricSolver", "make_solver"]

# Unknowns from which on the iterative solver takes over. It finds an equilibrium by itself sooner from 45,000 on; one with sensitivities,
# whose many right-hand sides need a factor, from about 100,000 on (tests/benchmarks/iterative_solver.py).
TAKES_OVER = 120_000


def make_solver(pattern: Pattern, name: str = "auto", levels: Levels | None = None) -> SymmetricSolver:
    """A solver by name: "pardiso", "superlu", "iterative", or "auto" for the quickest that this machine has.

    levels : of the displacements, for matrices that the iterative solver can serve; None for others. Raises ValueError when that one is
    asked for without them.
    """
    if name == "iterative" and levels is None:
        raise ValueError("the iterative solver serves quadratic elements with pressures at vertices only")
    if levels is not None and (name == "iterative" or (name == "auto" and pattern.n >= TAKES_OVER)):
        return Iterative(pattern, levels)
    return make_direct(pattern, name)
