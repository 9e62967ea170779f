"""What a picture of the window's 3D view is asked for with; see `renderer_process`."""

from __future__ import annotations

from typing import TypedDict


class MapRequest(TypedDict):
    """What colours the organ at rest: the map's file, whose `version` changes with it, and how it is shown."""

    file: str
    version: int
    scale: tuple[float, float, bool, str]
    untold: list[int]
    low_kpa: float | None
    high_kpa: float | None
    surest_factor: float | None


class ViewRequest(TypedDict):
    """Size in pixels, where it is looked from, and what is shown; colours : by "STATE LABEL", red, green, blue, opacity 0 to 1."""

    size: list[int]
    azimuth: float
    elevation: float
    zoom: float
    crosshair: list[float]
    states: list[str]
    colours: dict[str, list[float]]
    planes: list[str]
    window: list[float]
    residual: bool
    map: MapRequest | None
    fast: bool
