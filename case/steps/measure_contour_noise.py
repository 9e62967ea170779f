"""Contour noise measured from a second set of contours of the same scan: noise.json, which `identify` then uses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TypedDict

import numpy as np

from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.case.measured_noise import FILE
from palpate.case.second_contours import second_contours
from palpate.core.errors import InputError
from palpate.core.observe.repeat_contours import repeat_of
from palpate.core.surfaces.surface import Surface
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import organ_surfaces


class RepeatRecord(TypedDict):
    """One state contoured twice, mm: noise, its correlation length, distance of the contours; hash of the second
    file.
    """

    sd_mm: float
    correlation_mm: float
    apart_mm: float
    sha256: str


class NoiseRecord(TypedDict):
    """noise.json: standard deviation and correlation length of contour noise, mm, over all states and by state."""

    sd_mm: float
    correlation_mm: float
    states: dict[str, RepeatRecord]


def run(case: CaseFolder, drawn: Mapping[str, Path]) -> NoiseRecord:
    """Write noise.json and return it. drawn : state ("rest", "deformed") -> file of a second set of contours of its
    scan.

    Raises InputError where case.json states the noise already, the case has no labels of a state, or the two sets of
    contours are not of one organ.
    """
    if case.facts.boundary_noise_sd_mm is not None:
        raise InputError(
            f"{case.file('case.json')} states boundary_noise_sd_mm; set it to null there to have it measured from repeats"
        )
    states: dict[str, RepeatRecord] = {}
    for state, path in drawn.items():
        first, second = _organ(case.labels(state)), _organ(second_contours(case, state, path))
        repeat = repeat_of(first, second)
        states[state] = {
            "sd_mm": repeat.sd_mm, "correlation_mm": repeat.correlation_mm, "apart_mm": repeat.apart_mm, "sha256": file_sha256(path),
        }  # fmt: skip
    noise: NoiseRecord = {
        "sd_mm": float(np.sqrt(np.mean([s["sd_mm"] ** 2 for s in states.values()]))),
        "correlation_mm": float(np.mean([s["correlation_mm"] for s in states.values()])),
        "states": states,
    }
    case.write_json(FILE, noise)
    return noise


def _organ(labels: Volume) -> Surface:
    surface = organ_surfaces(labels)
    # As one region: the halves may be contoured in one set only.
    return Surface(surface.points, surface.faces, np.ones(len(surface.faces), dtype=np.int64))
