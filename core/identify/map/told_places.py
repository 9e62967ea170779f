"""Places of a map that differ from their half, patches that touch each other as one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from palpate.core.arrays import IntArray
from palpate.core.identify.map.patches import Patches
from palpate.core.identify.map.stiffness_map import StiffnessMap
from palpate.core.identify.result_record import PlaceRecord

# Centres of patches that touch each other are closer than this many diameters of balls as large as they are.
_TOUCH = 1.5
# Standard deviations of a 95 % interval.
_TWO_SIDED = 1.96


@dataclass(frozen=True, eq=False)
class Place:
    """Patches of one half that touch each other and all differ from it in one sense, 1 stiffer or -1 softer."""

    map: StiffnessMap
    patches: IntArray
    sense: int

    @property
    def extreme(self) -> int:
        """Patch that differs most."""
        return int(self.patches[np.argmax(self.sense * self.map.local.mean[self.patches])])


def places(found: StiffnessMap) -> list[Place]:
    """The largest first."""
    out = []
    for region in found.patches.regions:
        for sense in (1, -1):
            chosen = np.flatnonzero((found.called == sense) & (found.patches.region == region))
            out += [Place(found, chosen[group], sense) for group in _touching(found.patches, chosen)]
    return sorted(out, key=lambda place: -float(found.patches.volumes[place.patches].sum()))


def place_record(place: Place, names: Mapping[int, str]) -> PlaceRecord:
    """A place in the words of result.json. names : of the regions."""
    found, patches, at = place.map, place.map.patches, place.extreme
    volumes = patches.volumes[place.patches]
    x, y, z = (float(v) for v in np.average(patches.centres[place.patches], axis=0, weights=volumes))
    G, spread = float(np.exp(found.ln_G[at])), float(np.exp(_TWO_SIDED * found.sd[at]))
    return PlaceRecord(
        half=names[int(patches.region[at])],
        sense="stiffer" if place.sense > 0 else "softer",
        volume_cc=float(volumes.sum()) / 1000.0,
        centre_mm=(x, y, z),
        G_kpa=G,
        ci95_kpa=(G / spread, G * spread),
        times=float(np.exp(found.local.mean[at])),
    )


def _touching(patches: Patches, chosen: IntArray) -> list[IntArray]:
    """Positions in `chosen` (k,), grouped."""
    if not len(chosen):
        return []
    width = np.cbrt(6.0 * patches.volumes[chosen] / np.pi)
    near = cdist(patches.centres[chosen], patches.centres[chosen]) < _TOUCH * 0.5 * (width[:, None] + width)
    _, group = connected_components(csr_matrix(near), directed=False)
    return [np.flatnonzero(group == g) for g in range(int(group.max()) + 1)]
