"""The blind check's pelves: prostate, bladder, rectum and bone as plain solids, close to one another as in men.

The demonstration's phantom has a centimetre of fat around its prostate. What walls do then reaches the organ as a push of the whole, and
hardly anything hidden in it shows. Here 3 to 6 mm lie between them; in every second four builds a plane of fat
of 8 to 13 mm does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.labels import (
    BLADDER,
    BONE,
    OUTSIDE,
    PROSTATE_LEFT,
    PROSTATE_RIGHT,
    RECTUM,
    SURROUNDING_TISSUE,
)
from palpate.imaging.volume import Volume
from palpate.simulate.phantom.solids import Capsule, Ellipsoid, Solid, Tube
from palpate.simulate.phantom.unions import Union
from palpate.simulate.source import labels_on

# Semi-axes of the modelled region, a box with rounded edges, and its middle over the prostate's, mm; the power that rounds it.
_REGION_MM, _MIDDLE_MM, _POWER = np.array([50.0, 54.0, 54.0]), np.array([0.0, 5.0, 9.0]), 20
# Between prostate, bladder and rectum, mm: of builds without and with a plane of fat there.
_CLOSE_MM, _FAT_MM = (3.0, 6.0), (8.0, 13.0)
_VOXEL_MM, _MODEL_VOXEL_MM = (1.1, 1.1, 1.8), (1.25, 1.25, 1.25)


@dataclass(frozen=True, eq=False)
class Pelvis:
    """Solids, mm about the prostate (+x patient left, +y posterior, +z superior); split_mm : x of the plane between the halves."""

    prostate: Solid
    bladder: Solid
    rectum: Solid
    bones: tuple[Solid, ...]
    split_mm: float

    @classmethod
    def of(cls, build: int) -> Pelvis:
        """One of any number of builds, the same one for the same number."""
        rng = np.random.default_rng([build, 60])
        x, y, z = rng.uniform([19.0, 14.5, 18.5], [23.0, 17.5, 22.0])
        gap = rng.uniform(*(_FAT_MM if build % 8 >= 4 else _CLOSE_MM), 2)
        prostate = Union(
            (
                Ellipsoid((0.36 * x, 0.3, 0.5), (0.66 * x, y, z), 2.2),
                Ellipsoid((-0.35 * x, -0.4, -1.2), (0.66 * x, 0.95 * y, 0.94 * z), 2.2),
            ),
            8.0,
        )
        up, wide = rng.uniform(15.0, 18.0), rng.uniform(27.0, 32.0)
        bladder = Ellipsoid((rng.uniform(-3.0, 3.0), -5.0, z + gap[0] + up), (wide, 0.85 * wide, up), 2.2)
        deep, side = rng.uniform(10.5, 13.0), rng.uniform(-3.0, 3.0)
        back = y + gap[1] + deep
        rectum = Tube(
            (
                (-70.0, 0.0, back - 2.0, 11.0, deep - 1.5),
                (-30.0, 0.5 * side, back + 1.0, 14.0, deep - 0.5),
                (0.0, side, back, 16.0, deep),
                (28.0, side, back + 4.0, 16.5, deep + 1.0),
                (80.0, 1.5 * side, back + 16.0, 17.0, deep + 1.0),
            )
        )
        front = -y - rng.uniform(11.0, 15.0)
        bones: tuple[Solid, ...] = (
            Union(
                (
                    Ellipsoid((9.0, front, -6.0), (9.0, 8.0, 17.0)),
                    Ellipsoid((-8.5, front, -5.0), (9.0, 8.0, 16.0)),
                    Capsule((10.0, front, 2.0), (60.0, front + 16.0, 20.0), 8.0, 9.0),
                    Capsule((-10.0, front, 3.0), (-60.0, front + 18.0, 18.0), 8.0, 9.0),
                    Capsule((10.0, front + 2.0, -18.0), (52.0, 14.0, -44.0), 6.5, 8.0),
                    Capsule((-10.0, front + 2.0, -17.0), (-51.0, 15.0, -45.0), 6.5, 8.0),
                ),
                3.0,
            ),
            Capsule((49.0, 4.0, 10.0), (52.0, 12.0, 70.0), 11.0, 14.0),
            Capsule((-48.0, 5.0, 8.0), (-51.0, 13.0, 70.0), 11.0, 14.0),
            Capsule((0.0, 62.0, 14.0), (0.0, 66.0, 60.0), 7.0, 12.0),
        )
        return cls(prostate, bladder, rectum, bones, float(rng.uniform(-1.5, 1.5)))

    def labels(self, points: FloatArray) -> LabelArray:
        """Label (n,) of points (n, 3) mm at rest; 0 outside the modelled region."""
        out = np.full(len(points), SURROUNDING_TISSUE, dtype=np.uint8)
        organ = self.prostate.distance(points) < 0.0
        out[organ] = np.where(points[organ, 0] > self.split_mm, PROSTATE_LEFT, PROSTATE_RIGHT)
        for label, solids in ((BLADDER, (self.bladder,)), (RECTUM, (self.rectum,)), (BONE, self.bones)):
            for solid in solids:
                out[solid.distance(points) < 0.0] = label
        reach = (np.abs(points - _MIDDLE_MM) / _REGION_MM) ** _POWER
        return np.where(reach.sum(axis=1) < 1.0, out, OUTSIDE).astype(np.uint8)

    @property
    def label_grid(self) -> Volume:
        """Grid on which labels are written, empty."""
        return _grid(_VOXEL_MM)

    @property
    def model_labels(self) -> Volume:
        """Labels to be meshed."""
        return labels_on(self.labels, _grid(_MODEL_VOXEL_MM))


def _grid(voxel_mm: tuple[float, float, float]) -> Volume:
    spacing = np.array(voxel_mm)
    low = _MIDDLE_MM - _REGION_MM - 2.0 * spacing
    return Volume.upright(low, spacing, np.ceil((2.0 * _REGION_MM + 4.0 * spacing) / spacing))
