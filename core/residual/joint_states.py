"""Joint model of all deformed states: one stiffness and one effect, the states' data one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.residual.data_vector import DataVector
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.linearised_model import NOTHING, PLAIN, Hypothesis, Linearisation, StateModel


@dataclass(frozen=True, eq=False)
class JointLinearisation:
    """A model solved in every deformed state, at the same ln G and phi."""

    each: tuple[Linearisation, ...]

    @property
    def first(self) -> Linearisation:
        """Linearisation in the first deformed state, which pictures show."""
        return self.each[0]

    @property
    def theta(self) -> FloatArray:
        """ln G (t,)."""
        return self.first.theta

    @property
    def phi(self) -> FloatArray:
        """Parameters (k,) of the effect."""
        return self.first.phi

    @cached_property
    def residual(self) -> FloatArray:
        """Residual (n,) of all states."""
        return np.concatenate([p.residual for p in self.each])

    @cached_property
    def in_theta(self) -> FloatArray:
        """Derivative (n, t) of the residual in ln G."""
        return np.vstack([p.in_theta for p in self.each])

    def corrected(self, before: ElementCorrection, after: ElementCorrection) -> JointLinearisation:
        """The same with the correction `after` in place of `before`."""
        ends = np.cumsum([len(p.residual) for p in self.each])[:-1]
        more = np.split(after.at(self.theta) - before.at(self.theta), ends)
        steeper = np.split(after.in_theta(self.theta) - before.in_theta(self.theta), ends)
        parts = zip(self.each, more, steeper, strict=True)
        return JointLinearisation(
            tuple(replace(p, residual=p.residual + c, in_theta=p.in_theta + d) for p, c, d in parts)
        )

    def with_phi(self, phi: FloatArray) -> JointLinearisation:
        """The same, as a linearisation of a model with parameters phi (k,)."""
        return JointLinearisation(tuple(replace(p, phi=phi) for p in self.each))


@dataclass(frozen=True, eq=False)
class JointModel:
    """Models of all deformed states. They share the mesh and the organ's contour at rest."""

    each: tuple[StateModel, ...]

    @property
    def first(self) -> StateModel:
        """Model of the first deformed state."""
        return self.each[0]

    @property
    def bounds(self) -> FloatArray:
        """Bounds (t, 2) of theta."""
        geometry = self.first.geometry
        return StiffnessParameters(geometry.problem.regions, geometry.problem.facts, geometry.split_mu).bounds

    @property
    def data_vectors(self) -> list[DataVector]:
        """Data vectors of the states."""
        return [model.data for model in self.each]

    @property
    def n(self) -> int:
        """Length of all data."""
        return sum(data.n for data in self.data_vectors)

    @property
    def rows(self) -> list[slice]:
        """Rows of each state among all data."""
        return rows_of(self.data_vectors)

    @property
    def surface(self) -> IntArray:
        """Rows of the organ's surface modes, of all states."""
        return np.concatenate(
            [np.arange(r.start, r.start + s.n_modes) for r, s in zip(self.rows, self.data_vectors, strict=True)]
        )

    @property
    def bones(self) -> list[slice | None]:
        """Rows of each state's bones, None where it has none."""
        return [
            slice(r.stop - 6, r.stop) if s.bone else None for r, s in zip(self.rows, self.data_vectors, strict=True)
        ]

    @cached_property
    def correction(self) -> ElementCorrection:
        """Correction of all residuals by the better element."""
        return ElementCorrection.stacked([model.correction for model in self.each])

    def corrected(self, correction: ElementCorrection) -> JointModel:
        """The same with another correction of all residuals."""
        return JointModel(
            tuple(replace(b, correction=correction.of(r)) for b, r in zip(self.each, self.rows, strict=True))
        )

    def solve(
        self, hypothesis: Hypothesis, theta: FloatArray, phi: FloatArray, near: JointLinearisation | None
    ) -> JointLinearisation | None:
        """The model at (theta, phi), started from the equilibria of `near`; None when a state has no equilibrium."""
        linearisations: list[Linearisation] = []
        for k, model in enumerate(self.each):
            linearisation = model.solve(hypothesis, theta, phi, None if near is None else near.each[k])
            if linearisation is None:
                return None
            linearisations.append(linearisation)
        return JointLinearisation(tuple(linearisations))

    def plain(self, theta: FloatArray, near: JointLinearisation | None) -> JointLinearisation | None:
        """The plain model at theta (t,); see `solve`."""
        return self.solve(PLAIN, theta, NOTHING, near)

    def directions(self, hypothesis: Hypothesis, at: JointLinearisation) -> FloatArray:
        """Derivative (n, k) of the residual in phi; see `StateModel.directions`."""
        return np.vstack([model.directions(hypothesis, p) for model, p in zip(self.each, at.each, strict=True)])


def rows_of(data_vectors: Sequence[DataVector]) -> list[slice]:
    """Rows of each state among all data."""
    ends = np.cumsum([0, *(s.n for s in data_vectors)]).tolist()
    return [slice(a, b) for a, b in pairwise(ends)]


def apart(parts: Sequence[FloatArray]) -> FloatArray:
    """Block-diagonal matrix (n, k) of the states' columns: what happens in each state alone."""
    return np.asarray(block_diag(*parts), dtype=np.float64)
