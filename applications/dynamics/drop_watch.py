"""Quantities recorded at every step of a fall, and the figures computed from them."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from palpate.applications.dynamics.march import Ledger
from palpate.applications.dynamics.mass import STANDARD_GRAVITY
from palpate.applications.dynamics.motion import Motion
from palpate.applications.dynamics.rigid import RigidSurface, depth
from palpate.core.arrays import FloatArray, IntArray


class Reached(TypedDict):
    """Time and speed at which the dish's contact layer is reached; None where it is not."""

    fall_mm: float | None
    fall_time_s: float | None
    fall_time_error: float | None
    impact_speed_mm_s: float | None


class FallFigures(Reached):
    """Figures of one fall, see `drop`; energies relative to that of the fall."""

    landed: bool
    rebound_mm: float | None
    flattest: float
    deepest_penetration_mm: float
    nearest_mm: float
    energy_scale_mj: float
    energy_growth: float
    lost_in_tissue: float
    lost_to_friction: float
    unaccounted: float
    steps: int
    steps_taken_again: int
    newton_iterations: int


class Watch:
    """Records at every step the depth of the surface in the dish and the height of the organ."""

    def __init__(self, nodes: FloatArray, faces: IntArray, on: RigidSurface) -> None:
        self._nodes, self._faces, self._on = nodes, faces, on
        self.times, self.depths, self.heights, self.fallen = (list[float]() for _ in range(4))

    def see(self, motion: Motion) -> None:
        """Record one step."""
        x = self._nodes + motion.u
        corners = x[self._faces]
        looked = np.vstack([corners.mean(axis=1), 0.5 * (corners + corners[:, [1, 2, 0]]).reshape(-1, 3), *corners])
        self.times.append(motion.time)
        self.depths.append(depth(self._on, looked))
        self.heights.append(float(np.ptp(x[:, 2])))
        self.fallen.append(-float(motion.u[:, 2].mean()))


def fall_figures(watch: Watch, ledger: Ledger, layer: float) -> FallFigures:
    """Plain values, see `drop`. layer : mm of the layer in which the dish presses back."""
    gaps, times, fallen = -np.array(watch.depths), np.array(watch.times), np.array(watch.fallen)
    inside = np.flatnonzero(gaps < layer)
    first = int(inside[0]) if len(inside) else len(gaps) - 1
    return {
        "landed": len(inside) > 0,
        **_fall(gaps, times, fallen, first if len(inside) else None, layer),
        "rebound_mm": max(0.0, float(gaps[first:].max()) - layer) if len(inside) else None,
        "flattest": min(watch.heights) / watch.heights[0],
        "deepest_penetration_mm": max(0.0, -float(gaps.min())),
        "nearest_mm": float(gaps.min()),
        "energy_scale_mj": 1e-3 * ledger.scale,
        "energy_growth": ledger.largest_growth,
        "lost_in_tissue": ledger.viscous / ledger.scale,
        "lost_to_friction": ledger.friction / ledger.scale,
        "unaccounted": ledger.unaccounted,
        "steps": len(ledger.times) - 1,
        "steps_taken_again": ledger.rejected,
        "newton_iterations": ledger.iterations,
    }


def _fall(gaps: FloatArray, times: FloatArray, fallen: FloatArray, first: int | None, layer: float) -> Reached:
    """The last free step, continued."""
    if first is None or first < 2:
        return {"fall_mm": None, "fall_time_s": None, "fall_time_error": None, "impact_speed_mm_s": None}
    k = first - 1
    dt = float(times[k] - times[k - 1])
    speed = float(fallen[k] - fallen[k - 1]) / dt + 0.5 * STANDARD_GRAVITY * dt
    closing = float(gaps[k - 1] - gaps[k]) / dt
    more = float(np.clip((gaps[k] - layer) / max(closing, 1e-12), 0.0, times[first] - times[k]))
    when, way = float(times[k]) + more, float(fallen[k]) + speed * more + 0.5 * STANDARD_GRAVITY * more**2
    error = when / float(np.sqrt(2.0 * way / STANDARD_GRAVITY)) - 1.0
    return {
        "fall_mm": way,
        "fall_time_s": when,
        "fall_time_error": error,
        "impact_speed_mm_s": speed + STANDARD_GRAVITY * more,
    }


def energies_of(ledger: Ledger) -> dict[str, FloatArray]:
    """By name and "time_s", after every step (steps + 1,), mN mm."""
    names = ("kinetic", "elastic", "gravity", "contact", "total")
    by_name = {name: np.array([getattr(e, name) for e in ledger.energies]) for name in names}
    return {"time_s": np.array(ledger.times)} | by_name
