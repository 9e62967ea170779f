"""From drawn keyframes to a moving figure: mesh of the first keyframe, fit of stiffness and forces, motion."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.applications.sketch.closing import closed
from palpate.applications.sketch.drawings.drawing import Drawing, read_drawing
from palpate.applications.sketch.extrude import mesh_figure
from palpate.applications.sketch.figure import Figure, FigureOptions, held_points
from palpate.applications.sketch.fit import Fit, fit_keyframes
from palpate.applications.sketch.fit_walk import FitOptions
from palpate.applications.sketch.matching import matched
from palpate.applications.sketch.motion import Moving, animate
from palpate.applications.sketch.outline import Outline
from palpate.applications.sketch.residual import Target
from palpate.applications.sketch.sides import SIDES
from palpate.applications.sketch.sketch_options import SketchOptions
from palpate.applications.sketch.sketch_summary import SketchRecord, summary_of
from palpate.applications.sketch.swarm_fit import swarm_fit
from palpate.core.arrays import IntArray
from palpate.core.errors import InputError
from palpate.core.surfaces.triangles import normals
from palpate.core.worker.progress import Progress, part, silent

# Number of cells of a figure of one colour, and of several. A ratio is off by 11 % with 600 cells and by 4 % with 1,500
# (measured).
_CELLS, _CELLS_OF_PARTS = 600, 1500
# Steps along the observed rim, in figure sizes.
_SPACING = 0.01
# A side is held when this share of its rim (_MOST) lies within _STAYS of every keyframe's line, in figure sizes. Points
# within _CORNER of a side that is held already are left out: they say nothing of the next side.
_STAYS, _MOST, _CORNER = 0.02, 0.9, 0.1


@dataclass(frozen=True, eq=False)
class Sketch:
    """Result of the step. drawings : as read. figure, fit, moving : see their modules. summary : content of
    sketch.json.
    """

    drawings: tuple[Drawing, ...]
    figure: Figure
    fit: Fit
    moving: Moving
    summary: SketchRecord


def run_sketch(keys: Sequence[Path], options: SketchOptions | None = None, progress: Progress = silent) -> Sketch:
    """Moving figure of keyframes `keys`; no file is written.

    Raises InputError (file, what, remedy) for drawings that are not keyframes of one figure, ConvergenceError where the
    figure cannot reach them.
    """
    options = options or SketchOptions()
    began = time.perf_counter()
    progress(0.0, "reading the drawings")
    first = read_drawing(keys[0], size_mm=options.size_mm)
    drawings = (first, *(read_drawing(key, first.scale) for key in keys[1:]))
    held = options.hold if options.hold is not None else _held(drawings)
    targets = _targets(keys, drawings, held)
    progress(0.04, "meshing the first keyframe")
    cells = options.cells or (_CELLS if len(first.picture.colours) == 1 else _CELLS_OF_PARTS)
    mesh = mesh_figure(first.outline, first.part_at, cells)
    rim = first.outline.resampled(_SPACING * first.outline.size)
    figure = Figure(mesh, rim, FigureOptions(held, options.poisson_ratio))
    fit_options = FitOptions(options.line_error)
    # Without a ratio to find, a low degree serves as start: the springs of `closed` do the rest.
    highest = options.highest_degree if len(figure.parts) > 1 else min(1, options.highest_degree)
    fit = fit_keyframes(figure, targets, fit_options, highest, part(progress, 0.1, 0.6))
    swarm = None
    if options.swarm is not None and len(figure.parts) > 1:
        swarm, _ = swarm_fit(figure, targets, fit, fit_options, options.swarm, part(progress, 0.6, 0.75))
    progress(0.76, "drawing the rim onto the lines")
    fit = closed(figure, targets, fit)
    moving = animate(figure, fit, options.motion, part(progress, 0.8, 1.0))
    summary = summary_of(keys, drawings, figure, fit, moving, options)
    if swarm is not None:
        summary["swarm"] = {"ratios": np.exp(swarm.theta).round(4).tolist(), "misfit": round(swarm.misfit, 3)}
    summary["seconds"] = round(time.perf_counter() - began, 1)
    return Sketch(drawings, figure, fit, moving, summary)


def _held(drawings: tuple[Drawing, ...]) -> tuple[str, ...]:
    return sides_that_stay(drawings[0].outline, [d.outline for d in drawings[1:]])


def _targets(keys: Sequence[Path], drawings: tuple[Drawing, ...], held: tuple[str, ...]) -> tuple[Target, ...]:
    unknown = sorted(set(held) - set(SIDES))
    if unknown:
        raise InputError(f"a figure has no side '{unknown[0]}'; choose from {', '.join(SIDES)}")
    rest = drawings[0].outline
    rim = rest.resampled(_SPACING * rest.size)
    targets = []
    for key, drawing in zip(keys[1:], drawings[1:], strict=True):
        larger = drawing.outline.area / rest.area
        if not 0.25 < larger < 4.0:
            raise InputError(f"{key} shows a figure of {larger:.2g} times the first one's area; draw the same one")
        outline = drawing.outline.resampled(_SPACING * rest.size)
        targets.append(Target(outline, matched(rim, outline, str(key), bool(held))))
    return tuple(targets)


def triangles(figure: Figure) -> tuple[IntArray, IntArray]:
    """Front faces (f, 3) of the figure's mesh and the part (f,) each belongs to, for pictures."""
    mesh = figure.space.mesh
    faces, owner = mesh.boundary
    front = normals(mesh.points[faces])[:, 2] > 0.5
    return faces[front], mesh.regions[owner[front]]


def sides_that_stay(rest: Outline, keys: Sequence[Outline]) -> tuple[str, ...]:
    """Names of the sides of the first keyframe's box whose rim is in the same place in every other keyframe."""
    stays: list[str] = []
    for side in SIDES:
        own = held_points(rest.points, rest, (side,)) & ~held_points(rest.points, rest, tuple(stays), _CORNER)
        rim = rest.points[own]
        if len(rim) and all((key.distances(rim) < _STAYS * rest.size).mean() > _MOST for key in keys):
            stays.append(side)
    return tuple(stays)
