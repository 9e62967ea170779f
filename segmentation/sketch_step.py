"""Drawn keyframes to a moving figure: read, mesh the first, fit stiffness and forces, move."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import InputError
from palpate.core.sketch.closing import closed
from palpate.core.sketch.figure import FORCE_UNIT, SIDES, Figure, FigureOptions
from palpate.core.sketch.fit import HIT, Fit, FitOptions, fit_keyframes
from palpate.core.sketch.held import sides_that_stay
from palpate.core.sketch.matching import matched
from palpate.core.sketch.motion import MotionOptions, Moving, animate
from palpate.core.sketch.outline import Outline, hausdorff
from palpate.core.sketch.residual import Target
from palpate.core.sketch.swarm_fit import SwarmFitOptions, swarm_fit
from palpate.core.worker.progress import Progress, part, silent
from palpate.segmentation.case import file_sha256
from palpate.segmentation.drawing import Drawing, read_drawing
from palpate.segmentation.drawing_mesh import mesh_figure

# Cells of a figure of one colour, whose shape alone matters, and of one of several: measured, a ratio found with 600 is off by 11 %
# and with 1,500 by 4 %.
_CELLS, _CELLS_OF_PARTS = 600, 1500
# Steps along the observed rim, in figure sizes.
_SPACING = 0.01
# A ratio whose standard deviation (of ln) is larger than this is not told.
UNTOLD_SD = 0.7


@dataclass(frozen=True)
class SketchOptions:
    """size_mm : of the figure in the first keyframe. hold : sides that do not move, None to see from the keyframes.

    poisson_ratio : of all parts. line_error : of the drawn lines, in figure sizes. cells : of the mesh, about; None for what serves.
    pull_n_per_mm : the known total force on the figure in the second keyframe, N per mm of its thickness; without it stiffness is
    relative. swarm : options of the paper's search; None for Gauss-Newton alone. motion : of the film.
    """

    size_mm: float = 100.0
    hold: tuple[str, ...] | None = None
    poisson_ratio: float = 0.4
    line_error: float = 0.004
    cells: int | None = None
    highest_degree: int = 3
    pull_n_per_mm: float | None = None
    swarm: SwarmFitOptions | None = None
    motion: MotionOptions = field(default_factory=MotionOptions)


@dataclass(frozen=True, eq=False)
class Sketch:
    """What came of it. drawings : as read. figure, fit, moving : see core.sketch. summary : sketch.json."""

    drawings: tuple[Drawing, ...]
    figure: Figure
    fit: Fit
    moving: Moving
    summary: dict[str, Any]


def run_sketch(keys: Sequence[Path], options: SketchOptions | None = None, progress: Progress = silent) -> Sketch:
    """Nothing is written. Raises InputError (file, what, remedy) for drawings that are no keyframes of one figure,
    ConvergenceError where the figure cannot be brought to them."""
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
    # Where there is no ratio to find, forces need not be few.
    highest = options.highest_degree if len(figure.parts) > 1 else min(1, options.highest_degree)
    fit = fit_keyframes(figure, targets, fit_options, highest, part(progress, 0.1, 0.6))
    swarm = None
    if options.swarm is not None and len(figure.parts) > 1:
        swarm, _ = swarm_fit(figure, targets, fit, fit_options, options.swarm, part(progress, 0.6, 0.75))
    progress(0.76, "drawing the rim onto the lines")
    fit = closed(figure, targets, fit)
    moving = animate(figure, fit, options.motion, part(progress, 0.8, 1.0))
    summary = _summary(keys, drawings, figure, fit, moving, options)
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


def _summary(
    keys: Sequence[Path],
    drawings: tuple[Drawing, ...],
    figure: Figure,
    fit: Fit,
    moving: Moving,
    options: SketchOptions,
) -> dict[str, Any]:
    frames = [_keyframe(figure, fit, k, d.outline) for k, d in enumerate(drawings[1:])]
    G = None if options.pull_n_per_mm is None else _modulus(options.pull_n_per_mm, frames[0], keys[1])
    return {
        "keyframes_sha256": [file_sha256(key) for key in keys],
        "size_mm": options.size_mm,
        "held": list(figure.options.held),
        "parts": _parts(figure, fit, drawings[0], G),
        "poisson_ratio": options.poisson_ratio,
        "keyframes": frames,
        "hit": all(frame["hausdorff_percent"] < 100.0 * HIT for frame in frames),
        "forces": {"degree": fit.degree, "coefficients": fit.forces.size, "unit_over_G": FORCE_UNIT, "smooth_alone": fit.goals is None},
        "misfit": {"weighted": round(fit.misfit, 3), "looks": round(fit.looks, 1), "line_error_percent": 100 * options.line_error},
        "solver": {"forward_solves": fit.solves, "converged": fit.converged, "cells": len(figure.space.mesh.cells),
                   "element": figure.options.element},
        "pictures": len(moving.u),
        "in_words": _words(figure, fit, frames, G),
        "notes": [note for d in drawings for note in d.notes] + moving.notes,
    }  # fmt: skip


def _modulus(pull_n_per_mm: float, frame: dict[str, float], key: Path) -> float:
    """kPa of the first part, from the known total force. Raises InputError where the figure is pulled by none."""
    if not frame["force_per_mm_over_G"] > 0.0:
        raise InputError(
            f"{key} shows the figure under no force in all, so a known one tells no stiffness; leave --pull out"
        )
    return 1000.0 * pull_n_per_mm / frame["force_per_mm_over_G"]


def _keyframe(figure: Figure, fit: Fit, k: int, drawn: Outline) -> dict[str, float]:
    rim, size = figure.rim_at(fit.states[k].u), figure.outline.size
    both = np.concatenate([drawn.distances(rim.points), rim.distances(drawn.points)])
    force = np.tensordot(fit.forces[k], figure.force_basis(fit.degree), 1).sum(axis=0)
    if fit.goals is not None:
        force = force + figure.pull(fit.states[k].u, fit.goals[k], fit.spring)
    moved = np.linalg.norm(rim.points - figure.outline.points, axis=1)
    return {
        "rms_percent": round(100.0 * float(np.sqrt((both**2).mean())) / size, 3),
        "p95_percent": round(100.0 * float(np.percentile(both, 95)) / size, 3),
        "hausdorff_percent": round(100.0 * hausdorff(rim, drawn) / size, 3),
        "objective_mm2": round(float((drawn.distances(rim.points) ** 2).sum()), 4),
        "moved_percent": round(100.0 * float(moved.max()) / size, 1),
        "force_per_mm_over_G": round(float(np.linalg.norm(force)) / figure.thickness, 4),
    }


def _parts(figure: Figure, fit: Fit, first: Drawing, G: float | None) -> list[dict[str, Any]]:
    theta, sd = np.concatenate([[0.0], fit.theta]), np.concatenate([[0.0], np.sqrt(np.diag(fit.covariance))])
    out = []
    for k, number in enumerate(figure.parts):
        row: dict[str, Any] = {
            "colour": first.picture.colours[number - 1],
            "G_over_first": round(float(np.exp(theta[k])), 4),
        }
        row |= {
            "sd_ln": round(float(sd[k]), 4),
            "ci95": np.exp(theta[k] + 1.96 * sd[k] * np.array([-1, 1])).round(4).tolist(),
        }
        row["told"] = bool(k == 0 or sd[k] < UNTOLD_SD)
        if G is not None:
            row["G_kpa"] = round(float(G * np.exp(theta[k])), 4)
        out.append(row)
    return out


def _words(figure: Figure, fit: Fit, frames: list[dict[str, float]], G: float | None) -> list[str]:
    words = []
    if G is None:
        words.append("shapes tell forces over stiffness only: twice as stiff under twice the forces draws the same")
    else:
        words.append(f"with the force that was given, the first part has G = {G:.3g} kPa")
    if len(figure.parts) == 1:
        words.append("the figure has one colour, so one stiffness, and that is its unit: there is no ratio to find")
    for k, sd in enumerate(np.sqrt(np.diag(fit.covariance)), start=2):
        ratio = float(np.exp(fit.theta[k - 2]))
        told = f"part {k} is {ratio:.3g} times as stiff as part 1 (standard deviation {100 * sd:.0f} %)"
        words.append(
            told if sd < UNTOLD_SD else f"the keyframes do not tell how stiff part {k} is: other forces draw the same"
        )
    if fit.goals is not None:
        words.append("smooth forces alone do not hit the keyframes: forces from point to point of the rim were added")
    far = [k + 2 for k, frame in enumerate(frames) if frame["hausdorff_percent"] >= 100.0 * HIT]
    if far:
        words.append(
            f"keyframe {', '.join(map(str, far))} is not hit within {100 * HIT:.0f} % of the figure's size everywhere: its lines "
            "and the body's do not agree there"
        )
    return words


def triangles(figure: Figure) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Front faces (f, 3) of the figure's mesh and the part (f,) each belongs to, for pictures."""
    mesh = figure.space.mesh
    faces, owner = mesh.boundary
    X = mesh.points[faces]
    normal = np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
    front = normal[:, 2] > 0.5 * np.linalg.norm(normal, axis=1)
    return faces[front], mesh.regions[owner[front]]
