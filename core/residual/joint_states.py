"""All deformed states of a case at once: one stiffness and one effect, the states' data one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.linearised_model import Hypothesis, Linearisation, StateModel


@dataclass(frozen=True, eq=False)
class JointLinearisation:
    """A model solved in every state, at the same ln G and phi."""

    each: tuple[Linearisation, ...]

    @property
    def first(self) -> Linearisation:
        """In the first deformed state, which pictures show."""
        return self.each[0]

    @property
    def theta(self) -> FloatArray:
        """(t,) ln G."""
        return self.first.theta

    @property
    def phi(self) -> FloatArray:
        """(k,) the effect's parameters."""
        return self.first.phi

    @cached_property
    def residual(self) -> FloatArray:
        """(n,) of all states."""
        return np.concatenate([p.residual for p in self.each])

    @cached_property
    def in_theta(self) -> FloatArray:
        """(n, t) its derivative."""
        return np.vstack([p.in_theta for p in self.each])

    def corrected(self, correction: FloatArray) -> JointLinearisation:
        """The same with a correction (n,) added to the residual."""
        ends = np.cumsum([len(p.residual) for p in self.each])[:-1]
        parts = zip(self.each, np.split(correction, ends), strict=True)
        return JointLinearisation(tuple(replace(p, residual=p.residual + c) for p, c in parts))

    def with_phi(self, phi: FloatArray) -> JointLinearisation:
        """The same as points of a model with parameters phi."""
        return JointLinearisation(tuple(replace(p, phi=phi) for p in self.each))


@dataclass(frozen=True, eq=False)
class States:
    """Where models are tried, one bench for each deformed state. The states share the mesh and the organ's contour at rest."""

    each: tuple[StateModel, ...]

    @property
    def first(self) -> StateModel:
        """Of the first deformed state."""
        return self.each[0]

    @property
    def sights(self) -> list[DataVector]:
        """What each state shows."""
        return [bench.sight for bench in self.each]

    @property
    def n(self) -> int:
        """Length of all data."""
        return sum(sight.n for sight in self.sights)

    @property
    def rows(self) -> list[slice]:
        """Where each state's data are among all."""
        return rows_of(self.sights)

    @property
    def surface(self) -> IntArray:
        """Rows of the organ's surfaces, of all states."""
        return np.concatenate(
            [np.arange(r.start, r.start + s.n_modes) for r, s in zip(self.rows, self.sights, strict=True)]
        )

    @property
    def bones(self) -> list[slice | None]:
        """Rows of each state's bones, None where it has none."""
        return [slice(r.stop - 6, r.stop) if s.bone else None for r, s in zip(self.rows, self.sights, strict=True)]

    @cached_property
    def correction(self) -> FloatArray:
        """(n,) what a better element adds to every residual."""
        return np.concatenate([bench.correction for bench in self.each])

    def corrected(self, correction: FloatArray) -> States:
        """The same with another correction (n,)."""
        return States(tuple(replace(b, correction=correction[r]) for b, r in zip(self.each, self.rows, strict=True)))

    def solve(
        self, trial: Hypothesis, theta: FloatArray, phi: FloatArray, near: JointLinearisation | None
    ) -> JointLinearisation | None:
        """The model at (theta, phi), from a neighbour's equilibria; None when it has none in one of the states."""
        found: list[Linearisation] = []
        for k, bench in enumerate(self.each):
            point = bench.solve(trial, theta, phi, None if near is None else near.each[k])
            if point is None:
                return None
            found.append(point)
        return JointLinearisation(tuple(found))

    def directions(self, trial: Hypothesis, at: JointLinearisation) -> FloatArray:
        """(n, k) derivative of the residual in phi; see `StateModel.directions`."""
        return np.vstack([bench.directions(trial, p) for bench, p in zip(self.each, at.each, strict=True)])


def rows_of(sights: Sequence[DataVector]) -> list[slice]:
    """Where each state's data are among all."""
    ends = np.cumsum([0, *(s.n for s in sights)]).tolist()
    return [slice(a, b) for a, b in pairwise(ends)]


def apart(parts: Sequence[FloatArray]) -> FloatArray:
    """(n, k) of what happens in each state by itself, from each state's columns."""
    return np.asarray(block_diag(*parts), dtype=np.float64)
