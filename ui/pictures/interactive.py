"""The organ among its neighbours as a 3D view that turns under the mouse and plays the deformation, for one HTML file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from matplotlib.colors import to_hex
from matplotlib.ticker import LogLocator, MaxNLocator

from palpate.core.arrays import Float32Array, FloatArray, IntArray
from palpate.ui.pictures.colours import STIFFNESS_LABEL, StiffnessScale

_SHARES = np.linspace(0.0, 1.0, 11)
_FRAME_MS = 120
_LIGHT = {"ambient": 0.55, "diffuse": 0.7, "specular": 0.08, "roughness": 0.9}
_CONFIG = {"displaylogo": False, "responsive": True}


@dataclass(frozen=True, eq=False)
class MovingBody:
    """A surface and where it goes: points (n, 3) mm LPS at rest, move (n, 3) mm, faces (f, 3), rgb (f, 3) 0 to 1, opacity 0 to 1."""

    name: str
    points: FloatArray
    move: FloatArray
    faces: IntArray
    rgb: FloatArray
    opacity: float = 1.0

    @classmethod
    def of(
        cls, name: str, points: FloatArray, move: FloatArray, faces: IntArray, rgb: FloatArray, opacity: float
    ) -> MovingBody:
        """Of a mesh's points and some of its faces: keeps only the points that these use."""
        used, inverse = np.unique(faces, return_inverse=True)
        return cls(name, points[used], move[used], inverse.reshape(-1, 3), rgb, opacity)


def deformation_page(bodies: list[MovingBody], scale: StiffnessScale | None) -> str:
    """An HTML fragment with its program inside, that needs no network: it turns, zooms, hides bodies and plays rest to deformed.

    scale : of the colour bar in kPa; None for no bar.
    """
    figure = go.Figure([*(_mesh(body) for body in bodies), *([_bar(scale)] if scale else [])])
    moving = [k for k, body in enumerate(bodies) if np.any(body.move)]
    if moving:
        figure.frames = [_frame(bodies, moving, share) for share in _SHARES]
        figure.update_layout(updatemenus=[_buttons()], sliders=[_slider()])
    figure.update_layout(
        template="none",
        height=720,
        margin={"l": 0, "r": 0, "t": 10, "b": 100},
        legend={"x": 0.0, "y": 1.0, "itemsizing": "constant"},
        scene=_axes(bodies),
    )
    return str(figure.to_html(full_html=False, include_plotlyjs=True, auto_play=False, config=_CONFIG))


def _mesh(body: MovingBody) -> go.Mesh3d:
    i, j, k = body.faces.T.astype(np.int32)
    colours = {"facecolor": [to_hex(c) for c in body.rgb]} if len(np.unique(body.rgb, axis=0)) > 1 else {}
    return go.Mesh3d(
        **_coordinates(body, 0.0), i=i, j=j, k=k, color=to_hex(body.rgb[0]), opacity=body.opacity, name=body.name,
        flatshading=False, lighting=_LIGHT, showlegend=True, hoverinfo="name", **colours,
    )  # fmt: skip


def _coordinates(body: MovingBody, share: float) -> Mapping[str, Float32Array]:
    x, y, z = (body.points + share * body.move).T.astype(np.float32)
    return {"x": x, "y": y, "z": z}


def _frame(bodies: list[MovingBody], moving: list[int], share: float) -> go.Frame:
    return go.Frame(
        data=[go.Mesh3d(**_coordinates(bodies[k], share)) for k in moving], traces=moving, name=f"{100 * share:.0f}"
    )


def _limits(bodies: list[MovingBody]) -> tuple[FloatArray, FloatArray]:
    """Corners of the box that holds every body at every share."""
    ends = np.concatenate([p for body in bodies for p in (body.points, body.points + body.move)])
    return ends.min(axis=0) - 4.0, ends.max(axis=0) + 4.0


def _letters(low: FloatArray, high: FloatArray) -> list[dict[str, object]]:
    """R L A P I S at the middle of the box's sides, in front of everything; the axes are LPS."""
    places = np.tile((low + high) / 2.0, (6, 1))
    for axis in range(3):
        places[2 * axis, axis], places[2 * axis + 1, axis] = low[axis], high[axis]
    look = {"showarrow": False, "font": {"size": 18, "color": "#1b1f24"}, "bgcolor": "rgba(255,255,255,0.7)"}
    return [
        {**look, "x": float(x), "y": float(y), "z": float(z), "text": letter}
        for letter, (x, y, z) in zip("RLAPIS", places, strict=True)
    ]


def _bar(scale: StiffnessScale) -> go.Scatter3d:
    """A point that is not drawn, for its colour bar."""
    locator = LogLocator(subs=(1.0, 2.0, 5.0)) if scale.log else MaxNLocator(6)
    ticks = [float(t) for t in locator.tick_values(scale.low, scale.high) if scale.low <= t <= scale.high]
    shades = np.linspace(0.0, 1.0, 33)
    colours = [[float(s), to_hex(scale.colormap(s))] for s in shades]
    bar = {
        "title": {"text": STIFFNESS_LABEL, "side": "right"}, "tickvals": [float(scale.norm(t)) for t in ticks],
        "ticktext": [f"{t:g}" for t in ticks], "len": 0.8, "thickness": 16,
    }  # fmt: skip
    marker = {
        "size": 0.1,
        "opacity": 0.0,
        "color": [0.0],
        "cmin": 0.0,
        "cmax": 1.0,
        "colorscale": colours,
        "colorbar": bar,
    }
    return go.Scatter3d(x=[None], y=[None], z=[None], mode="markers", marker=marker, showlegend=False, hoverinfo="skip")


def _axes(bodies: list[MovingBody]) -> dict[str, object]:
    low, high = _limits(bodies)
    titles = ("x: right to left, mm", "y: front to back, mm", "z: feet to head, mm")
    quiet = {"backgroundcolor": "#f5f7f9", "gridcolor": "#d5dbe1", "showbackground": True, "nticks": 5}
    axes: dict[str, object] = {
        f"{name}axis": {**quiet, "range": [float(a), float(b)], "title": {"text": title}}
        for name, title, a, b in zip("xyz", titles, low, high, strict=True)
    }
    # From the front, a little from the left and above, as the still picture beside it.
    camera = {"eye": {"x": 1.0, "y": -1.9, "z": 0.75}, "up": {"x": 0, "y": 0, "z": 1}}
    return {**axes, "annotations": _letters(low, high), "aspectmode": "data", "camera": camera, "dragmode": "orbit"}


def _buttons() -> dict[str, object]:
    play = {"frame": {"duration": _FRAME_MS, "redraw": True}, "transition": {"duration": 0}, "fromcurrent": False}
    stop = {"frame": {"duration": 0, "redraw": True}, "mode": "immediate"}
    return {
        "type": "buttons", "direction": "left", "x": 0.0, "y": 0.0, "xanchor": "left", "yanchor": "top", "pad": {"t": 38},
        "buttons": [
            {"label": "Play", "method": "animate", "args": [None, play]},
            {"label": "Stop", "method": "animate", "args": [[None], stop]},
        ],
    }  # fmt: skip


def _slider() -> dict[str, object]:
    show = {"frame": {"duration": 0, "redraw": True}, "mode": "immediate", "transition": {"duration": 0}}
    steps = [{"label": f"{100 * s:.0f}", "method": "animate", "args": [[f"{100 * s:.0f}"], show]} for s in _SHARES]
    return {
        "steps": steps, "x": 0.2, "len": 0.75, "pad": {"t": 30},
        "currentvalue": {"prefix": "deformation shown, % (0 rest, 100 deformed): "},
    }  # fmt: skip
