"""The consistent mass of a space."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.fem.elements import quadrature, shape_functions
from palpate.core.fem.space import Space

KG_MM3 = 1e-9  # a density of 1 kg/m3 in kg/mm3
TISSUE_DENSITY = 1050.0 * KG_MM3  # soft tissue, ICRP Publication 110 (2009): prostate 1.03, muscle 1.05 g/cm3
STANDARD_GRAVITY = 9806.65  # mm/s2


@dataclass(frozen=True, eq=False)
class Mass:
    """cells : (m, k, k) kg, of each cell's nodes. matrix : (n, n) the same summed; it acts on each component alike."""

    cells: FloatArray
    matrix: sp.csr_matrix

    @classmethod
    def of(cls, space: Space, density: float | Mapping[int, float]) -> Mass:
        """Mass of a density in kg/mm3, one for all or one for each region. Raises InputError when one is missing or not
        positive.
        """
        points, weights = quadrature(5)  # exact to degree 5; the product of two quadratics is of degree 4
        N = shape_functions(space.element.degree, points)
        unit = np.einsum("q,qa,qb->ab", weights, N, N)
        cells = (_per_cell(space, density) * space.mesh.volumes)[:, None, None] * unit
        k = space.cell_nodes.shape[1]
        rows, columns = np.repeat(space.cell_nodes, k, axis=1).ravel(), np.tile(space.cell_nodes, (1, k)).ravel()
        matrix = sp.csr_matrix((cells.ravel(), (rows, columns)), shape=(space.n_nodes, space.n_nodes))
        return cls(cells, matrix)

    @property
    def total(self) -> float:
        """kg."""
        return float(self.matrix.sum())

    def times(self, v: FloatArray) -> FloatArray:
        """M v (n, 3) of v (n, 3)."""
        return np.asarray(self.matrix @ v)


def _per_cell(space: Space, density: float | Mapping[int, float]) -> FloatArray:
    regions = space.mesh.regions
    densities = density if isinstance(density, Mapping) else {int(r): density for r in np.unique(regions)}
    missing = sorted(set(np.unique(regions).tolist()) - set(densities))
    if missing:
        raise InputError(f"regions {missing} of the mesh have no density")
    out = np.zeros(len(regions))
    for region, value in densities.items():
        if not 0.0 < value < np.inf:
            raise InputError(f"the density of region {region} is {value:g} kg/mm3; a positive one is needed")
        out[regions == region] = value
    return out
