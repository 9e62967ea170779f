"""What lies under the crosshair, in words, and where it is put when a case is opened."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.identify.map.stiffness_map import called_at, nearest_patch
from palpate.imaging.labels import LABELS, ORGAN_LABELS
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.map_values import map_at
from palpate.ui.desktop.session.open_case import OpenCase
from palpate.ui.desktop.session.session import Session
from palpate.ui.pictures.planes import centre_of
from palpate.ui.report.measured_regions import YOUNG
from palpate.ui.report.regions import RegionStiffness
from palpate.ui.words.number_words import three_figures

Point = tuple[float, float, float]


def words_at_crosshair(session: Session) -> str:
    """HU, label and stiffness where the crosshair is."""
    state = "deformed" if session.display.mode == "deformed" else "rest"
    at = np.array([session.display.crosshair])
    words = []
    hu, label = _voxel(session.ct(state), at), _voxel(session.labels(state), at)
    if hu is not None:
        words.append(f"{hu:.0f} HU".replace("-", "\N{MINUS SIGN}"))
    if label is not None:
        words.append(LABELS[int(label)].replace("_", " "))
        words += _stiffness_words(session, int(label), state, at)
    return ", ".join(words)


def _stiffness_words(session: Session, label: int, state: str, at: FloatArray) -> list[str]:
    """What is known of the stiffness at a point (1, 3) mm of a label: by the map where that is shown, else of the region."""
    case, display = session.case, session.display
    if case is None or label not in ORGAN_LABELS:
        return []
    old = ["out of date"] if session.out_of_date("identify") else []
    if display.overlay == "map" and case.stiffness_map is not None and state == "rest":
        return _map_words(case, label, at, display.surest_factor, old)
    whole = "of the half " if display.overlay == "map" and len(case.regions) > 1 else ""
    found = [r for r in case.regions if r.label == label]
    return [f"G {whole}= {value_words(r)}" if r.determined else "stiffness not determined" for r in found] + (
        old if found else []
    )


def _map_words(case: OpenCase, label: int, at: FloatArray, factor: float | None, old: list[str]) -> list[str]:
    """The map's value at a point (1, 3) mm with its 95 % interval, and the half's, which is the one to quote."""
    arrays = case.stiffness_map
    assert arrays is not None
    half = np.array([label])
    (G,), (told,) = map_at(arrays, at, factor, half)
    if not told:
        return ["the map does not determine G here"]
    spread = float(np.exp(1.96 * np.asarray(arrays["sd"])[nearest_patch(arrays, at)][0]))
    interval = f"{three_figures(G / spread)}\N{EN DASH}{three_figures(G * spread)}"
    here = f"G here = {three_figures(G)} kPa (95 % {interval}), E = {three_figures(YOUNG * G)} kPa"
    halves = [f"quote the half: {value_words(r)}" for r in case.regions if r.label == label and r.determined]
    sense = {1: ["stiffer than its half"], -1: ["softer than its half"]}.get(int(called_at(arrays, at, half)[0]), [])
    return [here, *sense, *old, *halves]


def value_words(region: RegionStiffness) -> str:
    """A region's value with its 95 % interval, kPa."""
    value = f"{three_figures(region.G)} kPa"
    if region.ci is None:
        return value
    return f"{value} (95 % {three_figures(region.ci[0])}\N{EN DASH}{three_figures(region.ci[1])})"


def _voxel(volume: Volume | None, at: FloatArray) -> float | None:
    """The value of the voxel that holds a point (1, 3) mm; None outside."""
    if volume is None:
        return None
    value = float(volume.nearest(at, np.nan)[0])
    return None if np.isnan(value) else value


def first_place(labels: Volume | None, ct: Volume | None) -> Point | None:
    """Where the crosshair begins: in the organ, or the middle of the scan; None where neither is read yet."""
    if labels is None:
        return None if ct is None else _middle(ct)
    # Into the larger half: where the halves meet a sagittal slice shows neither.
    halves = [label for label in ORGAN_LABELS if (labels.array == label).any()]
    larger = max(halves, key=lambda label: int((labels.array == label).sum()), default=ORGAN_LABELS[0])
    _, y, z = centre_of(labels, ORGAN_LABELS)
    return float(centre_of(labels, (larger,))[0]), float(y), float(z)


def _middle(volume: Volume) -> Point:
    x, y, z = (float(c) for c in volume.to_lps((np.array([volume.array.shape]) - 1) / 2.0)[0])
    return x, y, z
