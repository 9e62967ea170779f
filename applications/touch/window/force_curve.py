"""Force against indentation of a touch: as a table for other programs, and as a picture."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from palpate.ui.pictures.colours import region_hex

_MARKERS = {"prostate_left": "o", "prostate_right": "s"}
_HELD = {"bed": "held by a bed of springs as soft as the tissue around it", "table": "its back stuck to a table"}


@dataclass(frozen=True)
class CurveRow:
    """One answer. point : (3,) mm LPS, of the surface at rest. indentation_mm : negative where the probe pulls; then the force is too.

    stiffness_n_per_mm : slope along the touch, None where there is none yet. error_n : estimate. solve : "quick" or "full".
    """

    touch: int
    region: str
    point: tuple[float, ...]
    probe_radius_mm: float
    indentation_mm: float
    force_n: float
    stiffness_n_per_mm: float | None
    error_n: float
    solve: str


def curve_csv(rows: Sequence[CurveRow]) -> str:
    """A line an answer, with a head."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(
        ["touch", "region", "x_mm", "y_mm", "z_mm", "probe_radius_mm", "indentation_mm", "force_n", "stiffness_n_per_mm",
         "error_n", "solve"]
    )  # fmt: skip
    for row in rows:
        slope = "" if row.stiffness_n_per_mm is None else f"{row.stiffness_n_per_mm:.6g}"
        table.writerow(
            [row.touch, row.region, *(f"{c:.3f}" for c in row.point), f"{row.probe_radius_mm:g}", f"{row.indentation_mm:.4f}",
             f"{row.force_n:.6g}", slope, f"{row.error_n:.3g}", row.solve]
        )  # fmt: skip
    return text.getvalue()


def force_curve(rows: Sequence[CurveRow], stiffness: Mapping[str, str], support: str) -> Figure:
    """A line for each place in the colour of its region, faint dots where the probe slid.

    stiffness : of each region, in words. support : what holds the organ.
    """
    figure = Figure(figsize=(5.4, 3.8), layout="constrained")
    axes = figure.subplots()
    named: set[str] = set()
    for part in _runs(rows):
        region, sliding = part[0].region, len(part) == 1
        colour, marker = region_hex(region), _MARKERS.get(region, "^")
        label = None if region in named else f"{region.replace('_', ' ')}, {stiffness[region]}"
        named.add(region)
        axes.plot([r.indentation_mm for r in part], [r.force_n for r in part], color=colour, marker=marker, label=label,
                  markersize=3, linewidth=1.2, alpha=0.4 if sliding else 1.0)  # fmt: skip
    axes.axhline(0.0, color="0.6", linewidth=0.8)
    axes.axvline(0.0, color="0.6", linewidth=0.8)
    radii = sorted({row.probe_radius_mm for row in rows})
    axes.set_xlabel("indentation of the surface at rest [mm]; negative: pulled", fontsize=8)
    axes.set_ylabel("force on the probe [N]", fontsize=8)
    sizes = " and ".join(f"{radius:g}" for radius in radii)
    held = _HELD.get(support, support)
    axes.set_title(f"rigid ball of {sizes} mm radius, no friction; organ alone,\n{held}; research use only", fontsize=7)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7)
    return figure


def _runs(rows: Sequence[CurveRow]) -> list[list[CurveRow]]:
    """Answers of one touch at one place that follow each other; a slide leaves one at each."""
    out: list[list[CurveRow]] = []
    for row in rows:
        if out and (out[-1][-1].touch, out[-1][-1].point) == (row.touch, row.point):
            out[-1].append(row)
        else:
            out.append([row])
    return out
