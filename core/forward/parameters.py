"""Identified parameters: the logarithm of every organ region's shear modulus, and the materials that follow from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.materials import Material
from palpate.core.fem.sensitivity import Direction
from palpate.core.laws import LAWS, LINEAR, Law, bulk_modulus, mooney_rivlin_parameters
from palpate.core.problem import Facts

# Number of the surrounding tissue in the label volumes.
TISSUE = 3
# Of mu1 / (mu1 + mu2): all but a law with one constant alone.
SHARE_BOUNDS = (0.02, 0.98)


@dataclass(frozen=True)
class StiffnessParameters:
    """theta = ln G of each organ region, its small-strain shear modulus in kPa whatever the organ's law; or, with `split_mu` and
    Mooney-Rivlin, (ln G, mu1 / (mu1 + mu2)) of each region.

    With ln G alone mu1 = mu2, as Yang & Lin set them (section 3.3). Small strains depend on G only, so a share beside G
    can be identified, where both of (mu1, mu2) could not. The organ's bulk modulus follows G by a
    fixed Poisson ratio: large, and not identified.
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
        """Lower and upper bounds (n, 2) of theta."""
        stiffness = np.log(self.facts.bounds_kpa)
        rows = [stiffness, SHARE_BOUNDS] if self.split_mu else [stiffness]
        return np.array(rows * len(self.regions), dtype=float)

    @property
    def stiffness(self) -> slice:
        """Positions in theta of the regions' ln G."""
        return slice(0, None, 2) if self.split_mu else slice(None)

    @property
    def shares(self) -> slice:
        """Positions in theta of the regions' mu1 / (mu1 + mu2); empty without `split_mu`."""
        return slice(1, None, 2) if self.split_mu else slice(0, 0)

    @property
    def law(self) -> Law:
        """The organ's."""
        return LAWS[self.facts.organ_law]

    def of_modulus(self, G: float) -> FloatArray:
        """The law's parameters (k,) kPa of shear modulus G, kPa; proportional to it."""
        return self.law.of_moduli(G, bulk_modulus(G, self.facts.organ_poisson_ratio))

    def shear_moduli(self, theta: FloatArray) -> FloatArray:
        """Shear modulus G (regions,) kPa of each region."""
        return np.exp(np.asarray(theta, dtype=float)[self.stiffness])

    def mu(self, theta: FloatArray) -> FloatArray:
        """mu1 and mu2 (regions, 2) kPa; of another law those of the Mooney-Rivlin organ with that G."""
        share = np.asarray(theta, dtype=float)[self.shares] if self.split_mu else np.full(len(self.regions), 0.5)
        return 0.5 * self.shear_moduli(theta)[:, None] * np.stack([share, 1.0 - share], axis=1)

    def materials(self, theta: FloatArray) -> dict[int, Material]:
        """Materials at theta: organ regions of their law in linear tissue (Eqs 8 and 3 of Yang & Lin)."""
        out = {r: Material(self.law, p) for r, p in zip(self.regions, self._organ(theta), strict=True)}
        G = self.facts.tissue_shear_modulus_kpa
        out[TISSUE] = Material(LINEAR, np.array([G, bulk_modulus(G, self.facts.tissue_poisson_ratio)]))
        return out

    def directions(self, theta: FloatArray) -> list[Direction]:
        """Derivatives of the laws' parameters in each theta."""
        out: list[Direction] = []
        for region, p in zip(self.regions, self._organ(theta), strict=True):
            out.append({region: p})  # of ln G: every law parameter is proportional to G
            if self.split_mu:
                out.append({region: np.array([p[0] + p[1], -p[0] - p[1], 0.0])})
        return out

    def _organ(self, theta: FloatArray) -> list[FloatArray]:
        if not self.split_mu:
            return [self.of_modulus(float(G)) for G in self.shear_moduli(theta)]
        rows = []
        for mu1, mu2 in self.mu(theta):
            G = 2.0 * (mu1 + mu2)
            K = bulk_modulus(G, self.facts.organ_poisson_ratio)
            rows.append(mooney_rivlin_parameters(G, K, mu1 / (mu1 + mu2)))
        return rows
