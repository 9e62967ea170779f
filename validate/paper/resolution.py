"""The paper's Figs 11 and 12: what the mesh's fineness does to what is found, over the size of the tumour."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent
from palpate.validate.paper.tumour_data import DATA_DIVISIONS, DATA_ELEMENT, tumour_data
from palpate.validate.paper.tumour_fit import TumourFit
from palpate.validate.paper.tumour_scene import NORMAL_MU, TUMOUR_MU, Divisions
from palpate.validate.paper.tumour_tables import PAPER_1

# The paper varies its meshes from 200 to 1,500 nodes.
MESHES = (Divisions(2, 1, 1), Divisions(2, 1, 3), Divisions(4, 1, 2), Divisions(4, 2, 4))


class ResolutionRow(TypedDict):
    """One mesh and element: mu (k,) kPa found at each tumour size, without noise and with; % by which the normal half is off."""

    element: str
    cells: int
    nodes: int
    tumour_mu_kpa: FloatArray
    normal_mu_kpa: FloatArray
    noisy_tumour_mu_kpa: FloatArray
    noisy_normal_mu_kpa: FloatArray
    normal_error_percent: FloatArray


class ResolutionTable(TypedDict):
    """Rows over the tumour's `share` of its half; `effective_mu_kpa` is what that half has."""

    study: str
    data_cells: int
    data_element: str
    noise_sd_mm: float
    share: list[float]
    effective_mu_kpa: list[float]
    rows: list[ResolutionRow]
    paper: str


@dataclass(frozen=True)
class ResolutionOptions:
    """meshes : that identify. elements : each on every mesh; "p1" is the paper's. every : so many-th of Table 1's columns."""

    meshes: tuple[Divisions, ...] = MESHES
    data: Divisions = DATA_DIVISIONS
    elements: tuple[str, ...] = ("p1", "p1p1", "p2p1")
    every: int = 1
    sd_mm: float = 0.4
    seed: int = 1

    @classmethod
    def quick(cls, seed: int = 1) -> ResolutionOptions:
        """Two coarse meshes and the quick elements."""
        return cls((Divisions(2, 1, 1), Divisions(2, 1, 3)), Divisions(4, 1, 1), ("p1", "p1p1"), 3, seed=seed)


def resolution(options: ResolutionOptions | None = None, progress: Progress = silent) -> ResolutionTable:
    """A row for each mesh and element: mu found of both halves at every tumour size, without noise and with."""
    o = options or ResolutionOptions()
    with one_thread():
        shares = PAPER_1.by[:: o.every]
        cases = []
        for k, share in enumerate(shares):
            progress(0.3 * k / len(shares), f"tumour of {100 * share:.0f} %")
            cases.append(tumour_data(share, TUMOUR_MU, o.data))
        pairs = [(element, mesh) for element in o.elements for mesh in o.meshes]
        rows = []
        for k, (element, mesh) in enumerate(pairs):
            progress(0.3 + 0.7 * k / len(pairs), f"{element}, {mesh.cells} cells")
            fit = TumourFit(cases[0].organ.rest, mesh, element, o.data)
            fit.set_noise(o.sd_mm)
            errors = fit.draw(np.random.default_rng(o.seed), len(cases), extraction=False)
            clean = np.array([fit.identify(case).mu for case in cases])
            noisy = np.array([fit.identify(case, error).mu for case, error in zip(cases, errors, strict=True)])
            rows.append(_row(fit, element, mesh, clean, noisy))
    progress(1.0, "done")
    return {
        "study": "resolution",
        "data_cells": o.data.cells,
        "data_element": DATA_ELEMENT,
        "noise_sd_mm": o.sd_mm,
        "share": [case.share for case in cases],
        "effective_mu_kpa": [case.effective_mu[0] for case in cases],
        "rows": rows,
        "paper": "200 to 1,500 nodes account for 1 to 5 % of error in the normal region",
    }


def _row(fit: TumourFit, element: str, mesh: Divisions, clean: FloatArray, noisy: FloatArray) -> ResolutionRow:
    return {
        "element": element,
        "cells": mesh.cells,
        "nodes": len(fit.scene.mesh.points),
        "tumour_mu_kpa": clean[:, 0],
        "normal_mu_kpa": clean[:, 1],
        "noisy_tumour_mu_kpa": noisy[:, 0],
        "noisy_normal_mu_kpa": noisy[:, 1],
        "normal_error_percent": 100.0 * np.abs(clean[:, 1] / NORMAL_MU - 1.0),
    }
