"""Organs of one scan carried over to the other by the motion that both CTs show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from palpate.core.arrays import IntArray
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.propagation.compared_scans import DrawnScan, moved_mask
from palpate.imaging.propagation.motion_prior import SurfacePoints
from palpate.imaging.propagation.options import PropagationOptions
from palpate.imaging.propagation.propagate import Propagation, propagation
from palpate.imaging.volume import Volume
from palpate.segmentation.methods.surface_mesh import Shell, shell_of_mask
from palpate.segmentation.pelvis import Segmentation
from palpate.segmentation.search_region import Found
from palpate.segmentation.surface_error import SHELL_MM, SurfaceErrors, expected_dice, spread_points

# How an organ came about that was carried over, in segmentation.json.
METHOD = "propagated"


@dataclass(frozen=True, eq=False)
class CarriedOrgan:
    """drawn : mask in the scan that it comes from. field : displacement (mi, mj, mk, 3) mm to the other scan. errors : of the
    surface there, beside those that it has in the first scan."""

    drawn: Volume
    field: Volume
    errors: SurfaceErrors

    def found(self, grid: Volume) -> Found:
        """The organ on a grid of the other scan."""
        return Found(moved_mask(self.drawn, self.field.at, grid), METHOD, self.errors.expected_dice)


def carried_organs(
    segmentation: Segmentation,
    drawn: Mapping[str, Volume],
    names: Sequence[str],
    scans: tuple[Volume, Volume],
    progress: Progress = silent,
    options: PropagationOptions | None = None,
) -> dict[str, CarriedOrgan] | None:
    """Organs of a segmented scan as they lie in another; None where the two CTs do not look alike under any motion.

    drawn : masks that a person drew, by organ; the segmentation's where nobody did. names : of those that are carried over.
    scans : CT that was drawn and the other one, in one frame. Raises InputError where they do not overlap about the organs.
    """
    grid = segmentation.scene.grid
    organs = {name: drawn.get(name, grid.with_array(organ.mask)) for name, organ in segmentation.organs.items()}
    shells = {name: shell_of_mask(organ.mask, grid, SHELL_MM) for name, organ in segmentation.organs.items()}
    chosen = {name: spread_points(shell, grid) for name, shell in shells.items()}
    surfaces = {name: _surface(shell, chosen[name]) for name, shell in shells.items()}
    found = propagation(DrawnScan(scans[0], organs), scans[1], surfaces, options, progress)
    if found is None:
        return None
    return {name: _carried(organs[name], shells[name], chosen[name], found) for name in names if name in organs}


def _surface(shell: Shell, chosen: IntArray) -> SurfacePoints:
    return SurfacePoints(shell.points[chosen], shell.normals[chosen])


def _carried(drawn: Volume, shell: Shell, chosen: IntArray, found: Propagation) -> CarriedOrgan:
    surface = _surface(shell, chosen)
    points = surface.points + found.field.at(surface.points)
    sd = found.motion.error(surface.points, surface.normals)
    moved = shell.moved(shell.points + found.field.at(shell.points))
    errors = SurfaceErrors(points, sd, expected_dice(moved, chosen, sd))
    return CarriedOrgan(drawn, found.field, errors)
