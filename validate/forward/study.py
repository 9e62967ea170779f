"""How wrong is each element, and how long does it take? The sphere in a cube against a finer mesh of the same polyhedral body."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.elements import DEFAULT_ELEMENT, ELEMENTS
from palpate.core.fem.meshes import ORGAN, refined, sphere_in_cube
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions
from palpate.core.fem.scenes import DRIVES, Scene, sphere_scene, standard_sphere_mesh
from palpate.core.mesh import TetMesh
from palpate.core.statistics import rms
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent
from palpate.validate.bench.options import BenchOptions
from palpate.validate.bench.reduced_study import ReducedFigures, reduced_study

REFERENCE_ELEMENT = "p2p1"


class Errors(TypedDict):
    """Of a solution at the mesh's vertices, over the largest displacement; that displacement in mm."""

    rms: float
    largest: float
    organ_rms: float
    largest_mm: float


class Row(Errors):
    """One element on one mesh in one scene."""

    ratio: float
    drive: str
    element: str
    cells: int
    unknowns: int
    seconds: float
    cpu_seconds: float
    converged: bool
    factorisations: int
    reference_converged: bool


class ForwardTable(TypedDict):
    """Rows at one size, and over sizes; processor seconds at 1 % error; the reference's own error; the reduced model ({}: left out)."""

    study: str
    default_element: str
    rows: list[Row]
    sizes: list[Row]
    seconds_to_1_percent: dict[str, float | None]
    reference_rms: float
    reduced_model: ReducedFigures | NoFigures


class NoFigures(TypedDict):
    """A part that was left out."""


@dataclass(frozen=True)
class ForwardOptions:
    """What to compare. cells : of the coarse mesh, about. ratios : v1 / mu. repeats : the least of so many times counts.

    levels : refinements of a coarse mesh of 480 cells over which the time to 1 % is read off and the reference's own error
    estimated; 0 leaves that part out. reduced : of the reduced model's study; None leaves that out.
    """

    cells: int = 4000
    ratios: tuple[float, ...] = (50.0, 200.0, 1000.0)
    drives: tuple[str, ...] = DRIVES
    elements: tuple[str, ...] = tuple(ELEMENTS)
    repeats: int = 3
    levels: int = 2
    reduced: BenchOptions | None = field(default_factory=BenchOptions)


def forward(options: ForwardOptions | None = None, progress: Progress = silent) -> ForwardTable:
    """Rows of every element, ratio and drive at one size, and of the sizes that lead to the time to 1 %."""
    options = options or ForwardOptions()
    with one_thread():
        return _forward(options, progress)


def _forward(options: ForwardOptions, progress: Progress) -> ForwardTable:
    mesh = standard_sphere_mesh(options.cells)
    cases = [(ratio, drive) for drive in options.drives for ratio in options.ratios]
    rows: list[Row] = []
    for k, (ratio, drive) in enumerate(cases):
        progress(0.7 * k / len(cases), f"v1/mu = {ratio:g}, by {drive}")
        rows += element_errors([mesh], refined(mesh), ratio, drive, options.elements, options.repeats)
    sizes: list[Row] = []
    if options.levels:
        progress(0.7, "time to 1 %")
        meshes = [sphere_in_cube(2, 1, 2)]
        for _ in range(options.levels):
            meshes.append(refined(meshes[-1]))
        sizes = element_errors(meshes[:-1], meshes[-1], 200.0, "traction", options.elements, options.repeats)
    reduced: ReducedFigures | NoFigures = {}
    if options.reduced is not None:
        reduced = reduced_study(options.reduced, lambda f, m: progress(0.85 + 0.15 * f, f"reduced model: {m}"))
    progress(1.0, "done")
    return {
        "study": "forward",
        "default_element": DEFAULT_ELEMENT,
        "rows": rows,
        "sizes": sizes,
        "seconds_to_1_percent": {
            e: seconds_to(0.01, [r for r in sizes if r["element"] == e]) for e in options.elements
        },
        "reference_rms": reference_rms([r["rms"] for r in sizes if r["element"] == REFERENCE_ELEMENT]),
        "reduced_model": reduced,
    }


def element_errors(
    meshes: list[TetMesh],
    fine: TetMesh,
    ratio: float,
    drive: str,
    elements: tuple[str, ...],
    repeats: int,
) -> list[Row]:
    """Rows of every element on each of nested meshes, against `REFERENCE_ELEMENT` on `fine`, which refines them all."""
    reference_scene = sphere_scene(fine, REFERENCE_ELEMENT, ratio, drive)
    reference = reference_scene.solve(NewtonOptions(stability=False))
    rows: list[Row] = []
    for mesh in meshes:
        for element in elements:
            scene = sphere_scene(mesh, element, ratio, drive)
            found, seconds, cpu_seconds = timed(scene, repeats)
            rows.append(
                {
                    "ratio": ratio,
                    "drive": drive,
                    "element": element,
                    "cells": len(mesh.cells),
                    "unknowns": scene.assembler.pattern.n,
                    "seconds": seconds,
                    "cpu_seconds": cpu_seconds,
                    "converged": found.converged,
                    "factorisations": found.factorisations,
                    "reference_converged": reference.converged,
                    **errors(mesh, found.u, reference.u),
                }
            )
    return rows


def timed(scene: Scene, repeats: int) -> tuple[Equilibrium, float, float]:
    """A cold equilibrium without the certificate of stability, and the least wall-clock and processor seconds of `repeats` solves."""
    best, options = np.full(2, np.inf), NewtonOptions(stability=False)
    for _ in range(max(1, repeats)):
        began = np.array([time.perf_counter(), time.process_time()])
        found = scene.solve(options)
        best = np.minimum(best, np.array([time.perf_counter(), time.process_time()]) - began)
    return found, float(best[0]), float(best[1])


def errors(mesh: TetMesh, u: FloatArray, reference: FloatArray) -> Errors:
    """rms and largest error at the mesh's vertices, which lead the reference's nodes too, over the largest displacement.

    rms : over all vertices. organ_rms : over the organ's, relative to the organ's largest displacement.
    """
    n = len(mesh.points)
    difference = np.linalg.norm(u[:n] - reference[:n], axis=1)
    size = np.linalg.norm(reference[:n], axis=1)
    organ = np.unique(mesh.cells[mesh.regions == ORGAN])
    return {
        "rms": float(rms(difference) / size.max()),
        "largest": float(difference.max() / size.max()),
        "organ_rms": float(rms(difference[organ]) / size[organ].max()),
        "largest_mm": float(size.max()),
    }


def reference_rms(errors_of_coarser: list[float]) -> float:
    """The reference's own error, from its element's on two meshes that it refines once and twice; NaN from fewer.

    With d1 and d2 the differences of those two meshes from the reference and errors e, e r, e r^2: d2 / d1 = r / (1 + r)
    where errors keep their sign, so the reference's is d2 r / (1 - r).
    """
    if len(errors_of_coarser) < 2:
        return float("nan")
    coarse, fine = errors_of_coarser[-2:]
    ratio = fine / (coarse - fine)
    return fine * ratio / (1.0 - ratio)


def seconds_to(error: float, rows: list[Row]) -> float | None:
    """Processor seconds at which the rms error passes `error`, by a line through the last two sizes in logarithms.

    None without two sizes, and where the line would have to be followed to less than a fifth of the smallest error.
    """
    if len(rows) < 2 or error < 0.2 * min(r["rms"] for r in rows[-2:]):
        return None
    rms, seconds = np.log([[r["rms"], r["cpu_seconds"]] for r in rows[-2:]]).T
    slope = (seconds[1] - seconds[0]) / (rms[1] - rms[0])
    return float(np.exp(seconds[1] + slope * (np.log(error) - rms[1])))


def study_text(found: ForwardTable) -> str:
    """The table for a person."""
    lines = [
        f"{'drive':13}{'v1/mu':>6}  {'element':8}{'unknowns':>9}{'rms %':>8}{'largest %':>11}{'seconds':>9}{'cpu s':>9}"
    ]
    for r in found["rows"]:
        lines.append(
            f"{r['drive']:13}{r['ratio']:6g}  {r['element']:8}{r['unknowns']:9}{100 * r['rms']:8.2f}"
            f"{100 * r['largest']:11.2f}{r['seconds']:9.3f}{r['cpu_seconds']:9.3f}"
            + ("" if r["converged"] else "  no equilibrium")
        )
    for element, seconds in found["seconds_to_1_percent"].items():
        lines.append(
            f"processor seconds to 1 %, {element}: " + ("not reached" if seconds is None else f"{seconds:.3g}")
        )
    lines.append(f"the reference's own error: {100 * found['reference_rms']:.3f} %")
    lines += [f"reduced model, {key}: {value:.4g}" for key, value in found["reduced_model"].items()]
    return "\n".join(lines)
