"""An analytic male pelvis: HU and label of any point, in patient coordinates (LPS, mm)."""

from __future__ import annotations

from functools import cache

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
from palpate.simulate.phantom import anatomy
from palpate.simulate.phantom.solids import Solid, near
from palpate.simulate.phantom.unions import Shrunk

# Where the anatomy's zero, about the prostate's centre, lies in the patient: nowhere near the scanner's origin.
ORIGIN_MM = np.array([-6.5, 11.0, -148.0])
# Over this width an edge goes from one tissue to the next: about a pixel, so that pixels need few samples.
EDGE_MM = 1.2

AIR_HU = -1000.0
GAS_HU = -980.0

# Height of the stool's level in the rectum, mm behind its centre line: the patient lies on the back.
GAS_LEVEL_MM = -1.5

# Painted in this order, each over what is there. HU as in portal-venous planning scans without contrast.
_LAYERS: tuple[tuple[float, tuple[Solid, ...]], ...] = (
    (-740.0, (anatomy.TABLE,)),
    (25.0, (anatomy.BODY,)),
    (-104.0, (Shrunk(anatomy.BODY, anatomy.SKIN_MM),)),
    (56.0, (anatomy.MUSCLE,)),
    (-92.0, anatomy.MUSCLE_FAT),
    (-90.0, anatomy.PELVIC_FAT),
    (52.0, anatomy.PELVIC_MUSCLE),
    (44.0, anatomy.VESSELS),
    (760.0, anatomy.BONES),
    (240.0, tuple(Shrunk(bone, anatomy.CORTEX_MM) for bone in anatomy.BONES)),
    (34.0, (anatomy.BLADDER,)),
    (6.0, (anatomy.URINE,)),
    (42.0, (anatomy.RECTUM,)),
    (28.0, (anatomy.RECTAL_LUMEN,)),
    (46.0, (anatomy.PROSTATE,)),
)


def hu(points: FloatArray) -> FloatArray:
    """CT number (n,) HU at points (n, 3) mm LPS: edges `EDGE_MM` wide, a faint texture that moves with the tissue, no noise."""
    local = np.asarray(points, dtype=np.float64) - ORIGIN_MM
    values = np.full(len(local), AIR_HU)
    for tissue, solids in _LAYERS:
        for solid in solids:
            _paint(values, local, solid, tissue)
    inside = np.flatnonzero(values > -500.0)
    values[inside] += _texture(local[inside])
    _paint_gas(values, local)
    return values


def labels(points: FloatArray) -> LabelArray:
    """Label (n,) of docs/case.md at points (n, 3) mm LPS; everything soft inside the skin is surrounding tissue."""
    local = np.asarray(points, dtype=np.float64) - ORIGIN_MM
    result = np.full(len(local), OUTSIDE, dtype=np.uint8)
    _mark(result, local, anatomy.BODY, SURROUNDING_TISSUE)
    _mark(result, local, anatomy.PROSTATE, PROSTATE_RIGHT)
    left = (result == PROSTATE_RIGHT) & (local[:, 0] > _split_x())
    result[left] = PROSTATE_LEFT
    _mark(result, local, anatomy.BLADDER, BLADDER)
    _mark(result, local, anatomy.RECTUM, RECTUM)
    for bone in anatomy.BONES:
        _mark(result, local, bone, BONE)
    return result


@cache
def prostate_centroid() -> tuple[float, float, float]:
    """Centre of volume of the prostate, mm LPS; the plane through it across x divides left from right."""
    low, high = anatomy.PROSTATE.bounds
    step = 0.5
    axes = [np.arange(a, b, step) + 0.5 * step for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    # A voxel at the edge counts by the share of it that lies inside.
    share = np.clip(0.5 - anatomy.PROSTATE.distance(points) / step, 0.0, 1.0)
    x, y, z = share @ points / share.sum() + ORIGIN_MM
    return float(x), float(y), float(z)


def _split_x() -> float:
    return prostate_centroid()[0] - float(ORIGIN_MM[0])


def _paint(values: FloatArray, local: FloatArray, solid: Solid, tissue: float) -> None:
    at = near(local, solid, EDGE_MM)
    share = np.clip(0.5 - solid.distance(local[at]) / EDGE_MM, 0.0, 1.0)
    values[at] += share * (tissue - values[at])


def _paint_gas(values: FloatArray, local: FloatArray) -> None:
    at = near(local, anatomy.RECTAL_LUMEN, EDGE_MM)
    points = local[at]
    section = anatomy.RECTUM.section(points[:, 2])
    level = points[:, 1] - section[:, 1] - GAS_LEVEL_MM - 2.0 * np.sin(points[:, 2] / 9.0)
    share = np.clip(0.5 - np.maximum(anatomy.RECTAL_LUMEN.distance(points), level) / EDGE_MM, 0.0, 1.0)
    values[at] += share * (GAS_HU - values[at])


def _mark(result: LabelArray, local: FloatArray, solid: Solid, label: int) -> None:
    at = near(local, solid, 0.0)
    result[at[solid.distance(local[at]) < 0.0]] = label


def _texture(local: FloatArray) -> FloatArray:
    """Unevenness of real tissue, (n,) HU, sd about 6: waves of 7 to 25 mm in fixed random directions."""
    rng = np.random.default_rng(20)
    directions = rng.normal(size=(10, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    waves = directions * (2.0 * np.pi / rng.uniform(7.0, 25.0, size=(10, 1)))
    phases = rng.uniform(0.0, 2.0 * np.pi, size=10)
    total = np.zeros(len(local))
    for wave, phase in zip(waves, phases, strict=True):
        total += np.cos(local @ wave + phase)
    return total * (6.0 * np.sqrt(2.0 / 10.0))
