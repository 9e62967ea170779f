"""Options of the sketch step."""

from __future__ import annotations

from dataclasses import dataclass, field

from palpate.applications.sketch.motion import MotionOptions
from palpate.applications.sketch.swarm_fit import SwarmFitOptions


@dataclass(frozen=True)
class SketchOptions:
    """size_mm : of the figure in the first keyframe. hold : sides that do not move, None to see from the keyframes.

    poisson_ratio : of all parts. line_error : of the drawn lines, in figure sizes. cells : of the mesh, about; None for
    what serves. pull_n_per_mm : the known total force on the figure in the second keyframe, N per mm of its thickness;
    without it stiffness is relative. swarm : options of the paper's search; None for Gauss-Newton alone. motion : of
    the film.
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
