"""Standard deviation of a surface's error from clues: a log-linear model for each organ, fitted to drawn contours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.sourced_number import sourced

# Least and most that is said, mm: what voxels leave of any contour, and half an organ.
FLOOR_MM, MOST_MM = 0.4, 12.0


@dataclass(frozen=True, eq=False)
class Clues:
    """At n points of a surface, (n,) each.

    local, whole : distance of the middle one of the perturbed runs' surfaces, mm, about the point and rms over the surface.
    weak, bare : 0 where the picture has a whole edge, 1 where it has none, about the point and over the surface. ends : mm
    from the organ's lowest or highest point along z. pointed : 1 where points or a box led the organ. doubt : 1 - the
    confidence by size, shape and neighbours (`Found`); it counts where nothing led the organ.
    """

    local: FloatArray
    whole: FloatArray
    weak: FloatArray
    bare: FloatArray
    ends: FloatArray
    pointed: FloatArray
    doubt: FloatArray

    @property
    def design(self) -> FloatArray:
        """Regressors (n, 8) of ln sd."""
        one = np.ones(len(self.local))
        local, whole = np.log(self.local + 0.5), np.log(self.whole + 0.5)
        ends, led = np.exp(-self.ends / 6.0), self.pointed
        return np.column_stack([one, local, whole, self.weak, self.bare, ends, led, (1.0 - led) * self.doubt])


@dataclass(frozen=True, kw_only=True)
class ErrorModel:
    """weights : of the regressors of `Clues.design`."""

    weights: tuple[float, ...]

    def sd_mm(self, clues: Clues) -> FloatArray:
        """Standard deviation (n,) mm."""
        return np.exp(clues.design @ np.array(self.weights))


_FIT = (
    "Maximum likelihood on 25 or 26 surfaces of 13 variants of two CTs with manual contours and of the phantom, found automatically "
    "and from six points (tests/benchmarks/surface_error_fit.py --contrast; seeds 9000 to 9009, and 9018, 9020 and 9023, picked for "
    "medium or no fat)."
)
_RECTUM_FIT = (
    "The same on 22 surfaces of 12 variants, since its course is found as a whole (tests/benchmarks/surface_error_fit.py --contrast "
    "--variants 12 --seed 9301)."
)
_WHAT = (
    "Weights of ln sd: constant, ln of the runs' spread here and over the whole surface, weak edge here and over it, ends, points "
    "given, doubt."
)


@dataclass(frozen=True, kw_only=True)
class ErrorNumbers:
    """The models' weights, by organ, and what the errors of two scans have in common."""

    prostate: Annotated[tuple[float, ...], sourced("1", _WHAT, _FIT)] = (-0.63, 0.13, 0.2, 0.2, 0.82, 0.0, 0.61, 1.07)
    bladder: Annotated[tuple[float, ...], sourced("1", _WHAT, _FIT)] = (-0.05, 0.0, 0.98, 0.2, 0.01, 0.09, -0.06, 0.0)
    rectum: Annotated[tuple[float, ...], sourced("1", _WHAT, _RECTUM_FIT)] = (
        0.35, 0.23, 0.24, 0.8, 0.0, 0.64, -0.05, 0.3,
    )  # fmt: skip
    common_share: Annotated[
        float,
        sourced(
            "1",
            "Share of the variance that the errors of both scans of a patient have in common.",
            "Chosen, below most pairs of variants of one scan: medians of the correlation of their errors are 0.88 (prostate), 0.55 "
            "(bladder) and 0.92 (rectum), lower quartiles 0.83, 0.48 and 0.61; a second state shows another anatomy.",
        ),
    ] = 0.5
    correlation_mm: Annotated[
        float,
        sourced(
            "mm",
            "Length l of the errors' correlation along the surface, exp(-r^2 / 2 l^2).",
            "Products of errors on the same variants fall to a half of their mean square at 18 mm, on all three organs.",
        ),
    ] = 15.0


def error_models(numbers: ErrorNumbers | None = None) -> dict[str, ErrorModel]:
    """The model of each organ."""
    numbers = numbers or ErrorNumbers()
    return {name: ErrorModel(weights=getattr(numbers, name)) for name in ("prostate", "bladder", "rectum")}
