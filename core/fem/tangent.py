"""Tangent of the equilibrium equations at one state, with the factor that solves with it."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.state import State


class Tangent:
    """Tangent matrix of an assembler at a state under a fraction of the load; owner of its factor.

    A solver holds the factor of one matrix at a time, and models with the same unknowns share a solver. Before every
    solve a tangent compares the solver's count of factorisations with that of its own. Where another matrix was
    factorised since, the tangent is assembled and factorised again, from the materials and terms that it was made with:
    a stale factor is never used.

    assembler : its mesh, unknowns and solver. state, load : where the tangent is taken. Materials and terms are those
    that the assembler has when the tangent is made; neither may be changed in place later.

    Raises FactorisationError when the matrix is singular or not finite.
    """

    def __init__(self, assembler: Assembler, state: State, load: float = 1.0) -> None:
        self._take(assembler, state, load)
        self._factorise()

    @classmethod
    def factorised(cls, assembler: Assembler, state: State, load: float) -> Tangent:
        """The same without a factorisation. Precondition: the last matrix that the solver factorised is this
        tangent.
        """
        out = cls.__new__(cls)
        out._take(assembler, state, load)
        return out

    def solve(self, b: FloatArray) -> FloatArray:
        """K^-1 b over the kept unknowns, for b (kept,) or (kept, r), to round-off."""
        if self.assembler.solver.factorisations != self._number:
            self._restore()
        return self.assembler.solver.solve(b)

    def set_materials(self) -> None:
        """Give the assembler the materials of this tangent, where it has others."""
        if self.assembler.materials is not self._materials:
            self.assembler.set_materials(self._materials)

    def displacements(self, b: FloatArray) -> FloatArray:
        """(r, n, 3) mm of K^-1 b for right-hand sides b (kept, r), zero at constrained unknowns."""
        space = self.assembler.space
        full = np.zeros((space.n_displacements + space.n_pressures, b.shape[1]))
        full[self.assembler.kept] = self.solve(b)
        return full[: space.n_displacements].T.reshape(b.shape[1], -1, 3)

    def _take(self, assembler: Assembler, state: State, load: float) -> None:
        self.assembler, self.state, self.load = assembler, state, load
        self._materials, self._terms = assembler.materials, assembler.terms
        self._number = assembler.solver.factorisations

    def _restore(self) -> None:
        # Not only where the materials differ: assemblers of one structure share a pressure block, which holds the last
        # one's moduli.
        self.assembler.set_materials(self._materials)
        self.assembler.terms = self._terms
        self._factorise()

    def _factorise(self) -> None:
        self.assembler.solver.factorise(self.assembler.tangent(self.state, self.load)[0])
        self._number = self.assembler.solver.factorisations
