"""A body on a bench in one state: its shape by the model, its markers, and what the model misses of their motion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from palpate.core.arrays import FloatArray
from palpate.ui.pictures.lettering import PAGE_INCHES, TEXT

_COLOURS = "viridis_r"
# The longest arrow over the body's length, and the magnifications that are easy to read.
_LONGEST, _STEPS = 0.12, (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
_BODY, _AT_REST = (0.86, 0.87, 0.9), (0.55, 0.58, 0.62)


def magnification(maps: Mapping[str, FloatArray], states: int) -> int:
    """By how much arrows of all states are drawn longer than they are."""
    length = float(np.ptp(maps["points"], axis=0).max())
    longest = max(float(np.nanmax(np.abs(maps[f"state_{k + 1}/residual"]), initial=0.0)) for k in range(states))
    return max((s for s in _STEPS if s * longest <= _LONGEST * length), default=1)


def body_in_state(maps: Mapping[str, FloatArray], state: int, times: int, limit_mm: float) -> Figure:
    """Two views of a state (from 0): along y and along z.

    maps : as `palpate.core.diagnose.bench_bodies.record.maps` gives them. times : magnification of what is missed.
    limit_mm : top of the colours.
    """
    across, *others = np.ptp(maps["points"], axis=0) * 1.25
    height = float(np.clip(3.2 * max(others) / across + 0.7, 1.7, 4.5))
    figure = Figure(figsize=(PAGE_INCHES, height), layout="constrained")
    axes = list(figure.subplots(1, 2))
    norm = Normalize(0.0, max(limit_mm, 1e-9))
    for ax, (across, up) in zip(axes, ((0, 2), (0, 1)), strict=True):
        _view(ax, maps, f"state_{state + 1}/", across, up, times, norm)
    bar = figure.colorbar(ScalarMappable(norm, _COLOURS), ax=axes, shrink=0.85)
    bar.set_label("missed, mm", fontsize=TEXT)
    bar.ax.tick_params(labelsize=TEXT)
    return figure


def _view(ax: Axes, maps: Mapping[str, FloatArray], at: str, across: int, up: int, times: int, norm: Normalize) -> None:
    faces, X = maps["faces"].astype(np.int64), maps["points"]
    x = X + maps[f"{at}displacement"]
    both = [across, up]
    ax.add_collection(PolyCollection(list(x[faces][:, :, both]), facecolor=_BODY, edgecolor="white", linewidth=0.25))
    ax.add_collection(
        PolyCollection(list(_edges(X, faces)[:, :, both]), facecolor="none", edgecolor=_AT_REST, linewidth=0.5)
    )
    missed = maps[f"{at}residual"]
    seen = maps[f"{at}rest"] + np.nan_to_num(maps[f"{at}moved"])
    arrow = -times * np.nan_to_num(missed)
    size = np.sqrt(np.nansum(missed**2, axis=1))
    ax.quiver(
        seen[:, across], seen[:, up], arrow[:, across], arrow[:, up], size, cmap=_COLOURS, norm=norm, angles="xy",
        scale_units="xy", scale=1.0, width=0.006, pivot="tip",
    )  # fmt: skip
    ax.scatter(seen[:, across], seen[:, up], c=size, cmap=_COLOURS, norm=norm, s=9, linewidths=0.3, edgecolors="black")
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_xlabel(f"{'xyz'[across]}, mm", fontsize=TEXT)
    ax.set_ylabel(f"{'xyz'[up]}, mm", fontsize=TEXT)
    ax.tick_params(labelsize=TEXT)


def _edges(X: FloatArray, faces: np.ndarray) -> FloatArray:  # type: ignore[type-arg]
    """Creases (e, 2, 3) mm of the surface at rest: edges whose two faces are turned to each other by more than 30 degrees."""
    normal = np.cross(X[faces[:, 1]] - X[faces[:, 0]], X[faces[:, 2]] - X[faces[:, 0]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-30)[:, None]
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    of = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, of = edges[order], of[order]
    pairs = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
    sharp = (normal[of[pairs]] * normal[of[pairs + 1]]).sum(axis=1) < np.cos(np.deg2rad(30.0))
    return X[edges[pairs[sharp]]]
