"""Direct solvers by name, behind one interface (`direct_solver.SymmetricSolver`)."""

from __future__ import annotations

from palpate.core.fem.linear.direct_solver import SymmetricSolver
from palpate.core.fem.linear.pardiso import Pardiso
from palpate.core.fem.linear.pattern import Pattern
from palpate.core.fem.linear.superlu import SuperLU


def make_direct(pattern: Pattern, name: str = "auto") -> SymmetricSolver:
    """A direct solver by name: "pardiso", "superlu", or "auto" for the first that this machine has."""
    if name == "superlu":
        return SuperLU(pattern)
    try:
        return Pardiso(pattern)
    except (ImportError, OSError):
        if name == "pardiso":
            raise
        return SuperLU(pattern)
