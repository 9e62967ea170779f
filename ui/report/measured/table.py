"""The tables of what a person measured: regions on the stiffness map, distances and angles."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.case.measured.measurements import Measurement, angle_degrees, length_mm
from palpate.ui.report.document import Block, Table
from palpate.ui.report.measured.regions import YOUNG, MeasuredRegion, slice_words
from palpate.ui.words.number_words import three_figures

_DASH = "\N{EN DASH}"
_HEADER = ("region", "slice", "area, mm\u00b2", "mean G, kPa", "95 % interval, kPa", "E = 3 G, kPa", "determined")
_CAPTION = (
    "Regions that a person drew on the stiffness map: mean over the part in the organ that the scans determine. The map is smoothed and "
    "less certain than the values of the halves."
)


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
