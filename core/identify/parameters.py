"""What is identified: the logarithm of every organ region's stiffness, and what laws it sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.fem.materials import Material
from palpate.core.fem.sensitivity import Direction
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters
from palpate.core.problem import Facts

FloatArray = NDArray[np.float64]

TISSUE = 3


@dataclass(frozen=True)
class StiffnessParameters:
    """theta = ln G of each organ region, G = 2 (mu1 + mu2) in kPa; or, with `split_mu`, (ln mu1, ln mu2) of each region.

    With ln G alone mu1 = mu2, as the paper sets them (its section 3.3); a pair of scans cannot separate them. The organ's bulk
    modulus follows G by a fixed Poisson ratio: large, and not identified.
    """

    regions: tuple[int, ...]
    facts: Facts
    split_mu: bool = False

    @property
    def n(self) -> int:
        """Number of parameters."""
        return len(self.regions) * (2 if self.split_mu else 1)

    @property
    def bounds(self) -> FloatArray:
        """(n, 2) lower and upper bound of theta."""
        low, high = np.log(self.facts.bounds_kpa)
        shift = np.log(4.0) if self.split_mu else 0.0
        return np.tile([low - shift, high - shift], (self.n, 1))

    def shear_moduli(self, theta: FloatArray) -> FloatArray:
        """G of each region, (regions,) kPa."""
        mu = np.exp(np.asarray(theta, dtype=float))
        return 2.0 * mu.reshape(-1, 2).sum(axis=1) if self.split_mu else mu

    def mu(self, theta: FloatArray) -> FloatArray:
        """(regions, 2) mu1, mu2 kPa."""
        value = np.exp(np.asarray(theta, dtype=float))
        return value.reshape(-1, 2) if self.split_mu else np.repeat(0.25 * value[:, None], 2, axis=1)

    def materials(self, theta: FloatArray) -> dict[int, Material]:
        """Mooney-Rivlin organ regions in linear tissue."""
        out = {r: Material(MOONEY_RIVLIN, p) for r, p in zip(self.regions, self._organ(theta), strict=True)}
        G = self.facts.tissue_shear_modulus_kpa
        out[TISSUE] = Material(LINEAR, np.array([G, bulk_modulus(G, self.facts.tissue_poisson_ratio)]))
        return out

    def directions(self, theta: FloatArray) -> list[Direction]:
        """For each theta, how the laws' parameters change with it."""
        if not self.split_mu:
            return [{r: p} for r, p in zip(self.regions, self._organ(theta), strict=True)]
        out: list[Direction] = []
        for region, (mu1, mu2) in zip(self.regions, self.mu(theta), strict=True):
            for d in (np.array([mu1, 0.0]), np.array([0.0, mu2])):
                K = bulk_modulus(2.0 * float(d.sum()), self.facts.organ_poisson_ratio)
                out.append({region: np.array([d[0], d[1], 0.5 * K])})
        return out

    def _organ(self, theta: FloatArray) -> list[FloatArray]:
        rows = []
        for mu1, mu2 in self.mu(theta):
            G = 2.0 * (mu1 + mu2)
            K = bulk_modulus(G, self.facts.organ_poisson_ratio)
            rows.append(mooney_rivlin_parameters(G, K, mu1 / (mu1 + mu2)))
        return rows
