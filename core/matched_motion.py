"""Motion of points between two scans, found in their images: the form in which it reaches the mechanics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.window_scores import WindowScores

# Why a point is not used, by number.
REASONS = (
    "",
    "matching back from the deformed scan leads elsewhere",
    "the scans differ by more than their noise in its window",
    "moves otherwise than its neighbours",
)


# Correlation of both scans about the organ, under the motion that was found, below which they do not show the same tissue. Chosen: pairs
# of one body have more than 0.95, a scan and its mirror image 0.75.
LEAST_ALIKE = 0.85


@dataclass(frozen=True, eq=False)
class MatchedMotion:
    """Points that both images show.

    points : (n, 3) mm in the scan at rest. moved : (n, 3) mm, their displacement to the deformed scan. precision :
    (n, 3, 3) 1/mm2 of each displacement; a direction that the image does not tell has none. correlation_mm : errors of
    two points a distance d apart have correlation exp(-(d / correlation_mm)^2), because their windows overlap.
    rejected : (m, 6) mm, rest position and displacement of points that are not used. rejected_for : (m,) why, an index
    of `REASONS`. scores : what the same windows say without a displacement of one point; None where only displacements are
    known. alike : correlation of the two scans' HU under the motion; 1 where nobody measured it.
    """

    points: FloatArray
    moved: FloatArray
    precision: FloatArray
    correlation_mm: float
    rejected: FloatArray = field(default_factory=lambda: np.zeros((0, 6)))
    rejected_for: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    scores: WindowScores | None = None
    alike: float = 1.0

    @property
    def is_of_one_body(self) -> bool:
        """Whether both scans show the same tissue, so that their motion says something."""
        return self.alike >= LEAST_ALIKE

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """For numpy.savez; `from_arrays` is the inverse."""
        scores = {} if self.scores is None else self.scores.arrays()
        return {f"scores/{key}": values for key, values in scores.items()} | {
            "points": self.points,
            "moved": self.moved,
            "precision": self.precision,
            "correlation_mm": np.array(self.correlation_mm),
            "rejected": self.rejected,
            "rejected_for": self.rejected_for,
            "alike": np.array(self.alike),
        }

    @classmethod
    def from_arrays(cls, data: Mapping[str, NDArray[np.generic]]) -> MatchedMotion:
        """Raises KeyError when an array is missing."""
        points, moved, precision, rejected = (
            np.asarray(data[key], dtype=np.float64) for key in ("points", "moved", "precision", "rejected")
        )
        reasons = np.asarray(data["rejected_for"], dtype=np.int64)
        found = {key.removeprefix("scores/"): values for key, values in data.items() if key.startswith("scores/")}
        scores = WindowScores.from_arrays(found) if found else None
        correlation = float(np.asarray(data["correlation_mm"]).item())
        alike = float(np.asarray(data["alike"]).item())
        return cls(points, moved, precision, correlation, rejected, reasons, scores, alike)
