"""Content of sketch.json: misfit of each keyframe, ratios of stiffness, forces, and a summary in words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NotRequired, TypedDict

import numpy as np

from palpate.applications.sketch.drawings.drawing import Drawing
from palpate.applications.sketch.figure import FORCE_UNIT, Figure
from palpate.applications.sketch.fit import HIT, Fit
from palpate.applications.sketch.motion import Moving
from palpate.applications.sketch.outline import Outline, hausdorff
from palpate.applications.sketch.sketch_options import SketchOptions
from palpate.case.case_folder import file_sha256
from palpate.core.errors import InputError
from palpate.core.statistics import rms

# Largest standard deviation of ln ratio of a ratio that is told.
UNTOLD_SD = 0.7


class KeyframeRecord(TypedDict):
    """How near the figure comes to a keyframe's line, in % of its size; total force per thickness (mm) over G."""

    rms_percent: float
    p95_percent: float
    hausdorff_percent: float
    objective_mm2: float
    moved_percent: float
    force_per_mm_over_G: float


class PartRecord(TypedDict):
    """Stiffness of one colour over the first one's; G in kPa where the total force is known."""

    colour: str
    G_over_first: float
    sd_ln: float
    ci95: list[float]
    told: bool
    G_kpa: NotRequired[float]


class ForcesRecord(TypedDict):
    """Of the forces along the rim."""

    degree: int
    coefficients: int
    unit_over_G: float
    smooth_alone: bool


class MisfitRecord(TypedDict):
    """Weighted misfit, independent looks in it, and the lines' error in % of the size."""

    weighted: float
    looks: float
    line_error_percent: float


class SolverRecord(TypedDict):
    """Work, and with what."""

    forward_solves: int
    converged: bool
    cells: int
    element: str


class SwarmRecord(TypedDict):
    """What the paper's search found."""

    ratios: list[float]
    misfit: float


class FilmRecord(TypedDict):
    """How the film is coded."""

    codec: str
    per_second: float


class SketchRecord(TypedDict):
    """sketch.json."""

    keyframes_sha256: list[str]
    size_mm: float
    held: list[str]
    parts: list[PartRecord]
    poisson_ratio: float
    keyframes: list[KeyframeRecord]
    hit: bool
    forces: ForcesRecord
    misfit: MisfitRecord
    solver: SolverRecord
    pictures: int
    in_words: list[str]
    notes: list[str]
    swarm: NotRequired[SwarmRecord]
    seconds: NotRequired[float]
    film: NotRequired[FilmRecord]


def summary_of(
    keys: Sequence[Path],
    drawings: tuple[Drawing, ...],
    figure: Figure,
    fit: Fit,
    moving: Moving,
    options: SketchOptions,
) -> SketchRecord:
    """What sketch.json holds, but for the swarm and the seconds. keys : the drawings' files."""
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


def _modulus(pull_n_per_mm: float, frame: KeyframeRecord, key: Path) -> float:
    """kPa of the first part, from the known total force. Raises InputError where the figure is pulled by none."""
    if not frame["force_per_mm_over_G"] > 0.0:
        raise InputError(
            f"{key} shows the figure under no force in all, so a known one determines no stiffness; leave --pull out"
        )
    return 1000.0 * pull_n_per_mm / frame["force_per_mm_over_G"]


def _keyframe(figure: Figure, fit: Fit, k: int, drawn: Outline) -> KeyframeRecord:
    rim, size = figure.rim_at(fit.states[k].u), figure.outline.size
    both = np.concatenate([drawn.distances(rim.points), rim.distances(drawn.points)])
    force = np.tensordot(fit.forces[k], figure.force_basis(fit.degree), 1).sum(axis=0)
    if fit.goals is not None:
        force = force + figure.pull(fit.states[k].u, fit.goals[k], fit.spring)
    moved = np.linalg.norm(rim.points - figure.outline.points, axis=1)
    return {
        "rms_percent": round(100.0 * rms(both) / size, 3),
        "p95_percent": round(100.0 * float(np.percentile(both, 95)) / size, 3),
        "hausdorff_percent": round(100.0 * hausdorff(rim, drawn) / size, 3),
        "objective_mm2": round(float((drawn.distances(rim.points) ** 2).sum()), 4),
        "moved_percent": round(100.0 * float(moved.max()) / size, 1),
        "force_per_mm_over_G": round(float(np.linalg.norm(force)) / figure.thickness, 4),
    }


def _parts(figure: Figure, fit: Fit, first: Drawing, G: float | None) -> list[PartRecord]:
    theta, sd = np.concatenate([[0.0], fit.theta]), np.concatenate([[0.0], np.sqrt(np.diag(fit.covariance))])
    out: list[PartRecord] = []
    for k, number in enumerate(figure.parts):
        row: PartRecord = {
            "colour": first.picture.colours[number - 1],
            "G_over_first": round(float(np.exp(theta[k])), 4),
            "sd_ln": round(float(sd[k]), 4),
            "ci95": np.exp(theta[k] + 1.96 * sd[k] * np.array([-1, 1])).round(4).tolist(),
            "told": bool(k == 0 or sd[k] < UNTOLD_SD),
        }
        if G is not None:
            row["G_kpa"] = round(float(G * np.exp(theta[k])), 4)
        out.append(row)
    return out


def _words(figure: Figure, fit: Fit, frames: list[KeyframeRecord], G: float | None) -> list[str]:
    words = []
    if G is None:
        words.append(
            "shapes determine forces over stiffness only: twice the stiffness under twice the forces gives the same shapes"
        )
    else:
        words.append(f"with the force that was given, the first part has G = {G:.3g} kPa")
    if len(figure.parts) == 1:
        words.append("the figure has one colour, so one stiffness, and that is its unit: there is no ratio to find")
    for k, sd in enumerate(np.sqrt(np.diag(fit.covariance)), start=2):
        ratio = float(np.exp(fit.theta[k - 2]))
        told = f"part {k} is {ratio:.3g} times as stiff as part 1 (standard deviation {100 * sd:.0f} %)"
        words.append(
            told
            if sd < UNTOLD_SD
            else f"the keyframes do not determine how stiff part {k} is: other forces give the same shapes"
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
