"""What is known of a pair whose model cannot be posed: the reason, and the motion of the organ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.identify.result_record import LandmarkRecord

# Spacing of the sampled points on the organ's surface, mm.
SURFACE_MM = 2.0


@dataclass(frozen=True, eq=False)
class NoInformation:
    """Why a pair tells no stiffness whatever its errors, and how the organ moves nevertheless.

    in_words : the reason. mesh_displacement : (n, 3) mm of the problem's mesh. points (q, 3), region (q,), displacement (q, 3) :
    of the organ's surface. expected_mm : rms distance that contours of this noise would leave. notes : further lines.
    landmarks, surface_mm : distances by way of moving landmarks and surface, for result.json; None where there are none.
    """

    in_words: str
    mesh_displacement: FloatArray
    points: FloatArray
    region: IntArray
    displacement: FloatArray
    expected_mm: float
    notes: tuple[str, ...] = ()
    landmarks: Mapping[str, LandmarkRecord] | None = None
    surface_mm: Mapping[str, float] | None = None
