"""Regions that a person drew on the stiffness map: area, mean stiffness, its interval, for window, report and SR; the report's tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from palpate.case.measured.measurements import REGIONS, Measurement, Point, angle_degrees, length_mm
from palpate.core.arrays import FloatArray, IntArray
from palpate.core.identify.map.region_mean import RegionMean, region_mean
from palpate.imaging.labels import ORGAN_LABELS
from palpate.imaging.volume import Volume
from palpate.ui.pictures.planes import PLANES, Plane
from palpate.ui.report.document import Block, Table
from palpate.ui.words.number_words import three_figures

YOUNG = 3.0  # E = 3 G of an incompressible material
_STEP_MM = 0.5
_PLANES = {plane.name: plane for plane in PLANES}
_DASH = "\N{EN DASH}"
_HEADER = ("region", "slice", "area, mm\u00b2", "mean G, kPa", "95 % interval, kPa", "E = 3 G, kPa", "determined")
_CAPTION = (
    "Regions that a person drew on the stiffness map: mean over the part in the organ that the scans determine. The map is smoothed and "
    "less certain than the values of the halves."
)


@dataclass(frozen=True)
class MeasuredRegion:
    """One region. area_mm2 : of its outline. organ_share : of the area that lies in the organ, 0 to 1. mean : over that part."""

    measurement: Measurement
    area_mm2: float
    organ_share: float
    mean: RegionMean

    @property
    def where(self) -> str:
        """The slice: ``axial, z = -148.0 mm``."""
        return slice_words(self.measurement)

    @property
    def interval_words(self) -> str:
        """The 95 % interval of G, kPa; empty where nothing is told."""
        interval = self.mean.interval_kpa
        return "" if interval is None else f"{three_figures(interval[0])} to {three_figures(interval[1])}"


def slice_words(measurement: Measurement) -> str:
    """The slice of a measurement: ``axial, z = -148.0 mm``."""
    plane = _PLANES[measurement.plane]
    place = f"{'xyz'[plane.normal]} = {measurement.points[0][plane.normal]:.1f} mm"
    return f"{plane.name}, {place}".replace("-", "\N{MINUS SIGN}")


def measured_region(
    measurement: Measurement, labels: Volume, arrays: Mapping[str, NDArray[np.generic]] | None
) -> MeasuredRegion:
    """A region on labels at rest and the map's arrays, None where there is no map."""
    plane = _PLANES[measurement.plane]
    points = inside_points(plane, measurement.points, _STEP_MM)
    halves = _halves(labels, points)
    organ = halves > 0
    nothing = RegionMean(None, None, 0.0)
    mean = nothing if arrays is None else region_mean(arrays, points[organ], halves[organ])
    share = float(organ.mean()) if len(points) else 0.0
    return MeasuredRegion(measurement, area_mm2(plane, measurement.points), share, mean)


def measured_regions(
    found: Sequence[Measurement], labels: Volume, arrays: Mapping[str, NDArray[np.generic]] | None
) -> list[MeasuredRegion]:
    """The regions among a person's measurements."""
    return [measured_region(one, labels, arrays) for one in found if one.kind in REGIONS]


def area_mm2(plane: Plane, points: Sequence[Point]) -> float:
    """Area within a closed outline."""
    x, y = np.array(points, dtype=float)[:, [plane.across, plane.down]].T
    return float(0.5 * abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)))


def inside_points(plane: Plane, points: Sequence[Point], step_mm: float) -> FloatArray:
    """Places (n, 3) mm on a grid of the slice that lie within a closed outline."""
    outline = np.array(points, dtype=float)
    flat = outline[:, [plane.across, plane.down]]
    axes = [np.arange(low + 0.5 * step_mm, high, step_mm) for low, high in zip(flat.min(0), flat.max(0), strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    grid = grid[Outline(flat).contains_points(grid)] if len(grid) else grid
    out = np.full((len(grid), 3), outline[0, plane.normal])
    out[:, [plane.across, plane.down]] = grid
    return out


def _halves(labels: Volume, points: FloatArray) -> IntArray:
    """(p,) half of the prostate that each point lies in; 0 beside it."""
    out = labels.nearest(points).astype(np.int64)
    return np.where(np.isin(out, ORGAN_LABELS), out, 0)


def measured_table(found: Sequence[MeasuredRegion]) -> list[Block]:
    """The table as the report's block; nothing where nothing was measured."""
    return [Table(_HEADER, [_row(region) for region in found], _CAPTION)] if found else []


def lines_table(found: Sequence[Measurement]) -> list[Block]:
    """Distances and angles as the report's block; nothing where none was measured."""
    rows = [(f"{one.name} ({one.kind})", slice_words(one), line_words(one)) for one in found]
    return [Table(("measured", "slice", "value"), rows, "Distances and angles that a person measured")] if rows else []


def line_words(one: Measurement) -> str:
    """Value of a distance or an angle: ``23.4 mm``."""
    if one.kind == "angle":
        return f"{angle_degrees(one.points):.1f}\N{DEGREE SIGN}"
    return f"{length_mm(one.points):.1f} mm"


def _row(region: MeasuredRegion) -> tuple[str, ...]:
    mean, G = region.mean, region.mean.G_kpa
    values = (_DASH,) * 3 if G is None else (three_figures(G), region.interval_words, three_figures(YOUNG * G))
    name = f"{region.measurement.name} ({region.measurement.kind})"
    return name, region.where, f"{region.area_mm2:.0f}", *values, f"{100.0 * mean.told_share:.0f} %"
