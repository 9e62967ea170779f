"""Law and parameter values of each region."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.laws.base import Law


@dataclass(frozen=True, eq=False)
class Material:
    """A law and its parameter values: (k,) for a whole region or (cells of the region, k), kPa."""

    law: Law
    values: ArrayLike

    def per_cell(self, n: int) -> FloatArray:
        """(n, k). Raises InputError when the shape does not fit or a value is not finite."""
        values = np.asarray(self.values, dtype=float)
        k = len(self.law.parameters)
        if values.shape not in ((k,), (n, k)):
            raise InputError(
                f"law '{self.law.name}' needs parameters {self.law.parameters} for {n} cells; got shape {values.shape}"
            )
        if not np.isfinite(values).all():
            raise InputError(f"law '{self.law.name}' has a parameter that is not finite: {values}")
        return np.ascontiguousarray(np.broadcast_to(values, (n, k)))


@dataclass(frozen=True, eq=False)
class MaterialGroup:
    """All cells of a mesh that obey one law: cell indices (n,) and parameters (n, k)."""

    law: Law
    cells: IntArray
    values: FloatArray


def group_by_law(regions: IntArray, materials: Mapping[int, Material]) -> list[MaterialGroup]:
    """One group per law. Raises InputError when a region of the mesh has no material."""
    missing = sorted(set(np.unique(regions).tolist()) - set(materials))
    if missing:
        raise InputError(f"regions {missing} of the mesh have no material")
    groups: dict[str, list[tuple[IntArray, FloatArray]]] = {}
    laws: dict[str, Law] = {}
    for region, material in sorted(materials.items()):
        cells = np.flatnonzero(regions == region)
        if len(cells):
            laws[material.law.name] = material.law
            groups.setdefault(material.law.name, []).append((cells, material.per_cell(len(cells))))
    out = []
    for name, parts in groups.items():
        cells = np.concatenate([c for c, _ in parts])
        out.append(MaterialGroup(laws[name], cells, np.ascontiguousarray(np.vstack([v for _, v in parts]))))
    return out
