"""Motion and contact against closed forms, and the energy of a soft ball that falls into a dish."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from palpate.applications.drop.scenes import BarImpact, Rebound, Slope, bar_impact, rebound, slope
from palpate.applications.dynamics.drop import Drop, DropFigures, DropOptions, dish_for, drop
from palpate.applications.dynamics.mass import TISSUE_DENSITY
from palpate.applications.dynamics.motion import Motion
from palpate.applications.dynamics.schemes import take_step
from palpate.applications.dynamics.system import MovingBody
from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import ORGAN, box, sphere_in_cube
from palpate.core.fem.space import Space
from palpate.core.laws import MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent

_SOFT = 10.0  # kPa, G of the ball


class DropTable(TypedDict):
    """Errors of every body, order of the time steps, and the ball's energies by kind, mN mm, over `time_s`."""

    study: str
    block: Rebound
    bar: BarImpact
    bar_cells: int
    sliding: Slope
    sticking: Slope
    order: float
    ball: DropFigures
    ball_energies: dict[str, list[float]]
    energy_growth: float


@dataclass(frozen=True)
class DropStudyOptions:
    """bar_cells : along the bar. dt : s, of the block's rebound; the block on the slope takes 20 times that. ball : how the ball falls."""

    bar_cells: int = 60
    dt: float = 5e-5
    ball: DropOptions = field(default_factory=lambda: DropOptions(height=20.0, seconds=0.2, frames=100.0, dt=5e-4))
    ball_cells: int = 3

    @classmethod
    def quick(cls) -> DropStudyOptions:
        """In some ten seconds."""
        return cls(30, 1e-4, DropOptions(height=8.0, seconds=0.08, frames=100.0), 2)


def drop_study(options: DropStudyOptions | None = None, progress: Progress = silent) -> DropTable:
    """Relative errors of each closed form, the observed order of the time steps, and the ball's figures and energies."""
    options = options or DropStudyOptions()
    with one_thread():
        progress(0.0, "stiff block")
        block = rebound(options.dt)
        progress(0.15, "bar")
        bar = bar_impact(options.bar_cells)
        progress(0.4, "block on a slope")
        sliding, sticking = slope(dt=20.0 * options.dt), slope(friction=0.6, dt=20.0 * options.dt)
        progress(0.55, "order of the time steps")
        order = observed_order()
        progress(0.6, "soft ball")
        ball = _ball(options, lambda f, m: progress(0.6 + 0.4 * f, f"soft ball, {m}"))
    growths = [scene["energy_growth"] for scene in (block, bar, sliding, sticking)] + [ball.figures["energy_growth"]]
    return {
        "study": "drop",
        "block": block,
        "bar": bar,
        "bar_cells": options.bar_cells,
        "sliding": sliding,
        "sticking": sticking,
        "order": order,
        "ball": ball.figures,
        "ball_energies": {name: values.tolist() for name, values in ball.energies.items()},
        "energy_growth": max(growths),
    }


def _ball(options: DropStudyOptions, progress: Progress) -> Drop:
    n = options.ball_cells
    mesh, _ = sphere_in_cube(n, max(1, n // 2), 1, 18.0, 40.0).submesh((ORGAN,))
    material = Material(MOONEY_RIVLIN, mooney_rivlin_parameters(_SOFT, bulk_modulus(_SOFT, 0.495)))
    return drop(mesh, {ORGAN: material}, dish_for([mesh]), options.ball, progress)


def observed_order(steps: tuple[int, int, int] = (32, 64, 128), seconds: float = 4e-4) -> float:
    """Of a spinning, vibrating block: log2 of the ratio of the differences between three runs, each of half the step before."""
    space = Space.of(box((12.0, 20.0, 9.0), (2, 3, 2), jitter=0.2, seed=4), "p1")
    assembler = Assembler(space, np.ones(space.n_displacements, dtype=bool))
    assembler.set_materials({1: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(15.0, bulk_modulus(15.0, 0.2)))})
    body = MovingBody(assembler, TISSUE_DENSITY, damping=2e-4)
    X = space.nodes - space.nodes.mean(axis=0)
    ends = []
    for count in steps:
        motion = Motion(0.0, 0.02 * X * [1.0, -1.0, 0.5], np.cross([12.0, -20.0, 32.0], X))
        for _ in range(count):
            step = take_step(body, motion, seconds / count, 1e-9)
            if step.motion is None:
                raise ConvergenceError(f"the block's motion stops: {step.reason}")
            motion = step.motion
        ends.append(motion.u)
    return float(np.log2(np.linalg.norm(ends[0] - ends[1]) / np.linalg.norm(ends[1] - ends[2])))
