"""The true stiffness of a simulated body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from palpate.core.fem.materials import Material
from palpate.core.laws.linear import LINEAR, bulk_modulus
from palpate.core.laws.mooney_rivlin import MOONEY_RIVLIN, mooney_rivlin_parameters
from palpate.imaging.labels import SURROUNDING_TISSUE

ORGAN_POISSON_RATIO = 0.495


@dataclass(frozen=True)
class Stiffness:
    """True shear moduli, kPa.

    organ : label -> G. tissue, tissue_poisson_ratio : of the surrounding tissue. mu1_share : mu1 / (mu1 + mu2).
    """

    organ: Mapping[int, float]
    tissue: float = 20.0
    tissue_poisson_ratio: float = 0.49
    mu1_share: float = 0.5

    def materials(self) -> dict[int, Material]:
        """Laws by region: Mooney-Rivlin organ (G = 2 (mu1 + mu2)), linear tissue."""
        result = {
            label: Material(
                MOONEY_RIVLIN, mooney_rivlin_parameters(G, bulk_modulus(G, ORGAN_POISSON_RATIO), self.mu1_share)
            )
            for label, G in self.organ.items()
        }
        K = bulk_modulus(self.tissue, self.tissue_poisson_ratio)
        result[SURROUNDING_TISSUE] = Material(LINEAR, np.array([self.tissue, K]))
        return result
