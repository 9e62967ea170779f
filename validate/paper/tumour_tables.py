"""The paper's Tables 1 and 2: a half with a tumour of growing size, then of growing stiffness; what is found beside what it has.

What a half has is its mean stress over its mean strain (`tumour_effective`, with two other answers beside). It is found by
weights that do not take the halves for uniform (`identify.uneven`), how uneven each is being told by the data where they are
without noise; what uniform halves would say stands beside.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypedDict

import numpy as np
from scipy import stats

from palpate.core.arrays import FloatArray
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, part, silent
from palpate.validate.paper.tumour_data import DATA_DIVISIONS, DATA_ELEMENT, TumourData, tumour_data
from palpate.validate.paper.tumour_fit import Found, TumourFit
from palpate.validate.paper.tumour_scene import NORMAL_MU, TUMOUR_MU, Divisions


class FoundHalves(TypedDict):
    """mu (2,) kPa of both halves, 95 % intervals (2, 2), sd (2,) of ln G, and of ln G within each half that was allowed for."""

    mu_kpa: FloatArray
    ci95_kpa: FloatArray
    sd_ln: FloatArray
    uneven_sd_ln: FloatArray


class PaperHalves(TypedDict):
    """mu, kPa, as printed."""

    tumour: float
    normal: float


class _OursRow(TypedDict):
    share: float
    tumour_mu_kpa: float
    effective_mu_kpa: FloatArray
    energy_in_place_mu_kpa: float
    energy_of_its_surface_mu_kpa: float
    clean: FoundHalves
    noisy: FoundHalves
    taken_as_uniform_mu_kpa: FloatArray
    error_percent: FloatArray


class TumourRow(_OursRow):
    """A column of the paper's table: the tumour, what its half has by three answers, what is found, what the paper found."""

    paper: PaperHalves


class CleanNoisy(TypedDict):
    """Pearson's correlation of what is found with what is varied."""

    clean: float
    noisy: float


By = Literal["share", "tumour_mu_kpa"]


class TumourTable(TypedDict):
    """Rows by what is varied (`by`), and the uniform organ."""

    study: str
    by: By
    noise_sd_mm: float
    cells: int
    element: str
    data_cells: int
    data_element: str
    meshes_mm: float
    normal_mu_kpa: float
    uniform: FoundHalves
    rows: list[TumourRow]
    correlation: CleanNoisy
    paper_correlation: float
    rises: bool
    largest_tumour_error_percent: float
    largest_normal_error_percent: float


# What the paper prints, kPa, mean of mu1 and mu2.
@dataclass(frozen=True)
class Paper:
    """A table as printed: by (share, or the tumour's mu), mu of both halves in kPa, its correlation coefficient."""

    by: tuple[float, ...]
    tumour: tuple[float, ...]
    normal: tuple[float, ...]
    correlation: float


PAPER_1 = Paper(
    (0.022, 0.14, 0.30, 0.49, 0.65, 0.76, 0.85),
    (30.63, 31.54, 39.18, 43.93, 51.23, 61.16, 71.01),
    (29.15, 28.89, 31.22, 30.17, 31.49, 29.31, 30.46),
    0.9659,
)
PAPER_2 = Paper(
    (70.0, 140.0, 210.0, 280.0, 350.0, 420.0, 490.0),
    (51.23, 112.92, 157.44, 186.78, 202.22, 254.20, 272.58),
    (31.49, 28.28, 30.04, 28.56, 27.62, 29.61, 25.18),
    0.9856,
)
SHARE_2 = 0.65


@dataclass(frozen=True)
class TableOptions:
    """identify, data : meshes. element : that identifies. every : take each so many-th of the paper's columns. seed : of the noise."""

    identify: Divisions = field(default_factory=Divisions)
    data: Divisions = DATA_DIVISIONS
    element: str = "p2p1"
    every: int = 1
    seed: int = 1

    @classmethod
    def quick(cls, seed: int = 1) -> TableOptions:
        """Seconds instead of minutes, on coarse meshes."""
        return cls(Divisions(2, 1, 1), Divisions(4, 1, 1), "p2p1", 3, seed)


def table1(options: TableOptions | None = None, progress: Progress = silent) -> TumourTable:
    """Rows of growing tumour; `correlation` is Pearson's of what is found with the tumour's share."""
    options = options or TableOptions()
    columns = zip(PAPER_1.by, PAPER_1.tumour, PAPER_1.normal, strict=True)
    cases = [(share, TUMOUR_MU, found, normal) for share, found, normal in columns]
    return _table("table1", "share", cases[:: options.every], PAPER_1.correlation, options, progress)


def table2(options: TableOptions | None = None, progress: Progress = silent) -> TumourTable:
    """Rows of growing tumour stiffness at `SHARE_2` of the half; `correlation` is Pearson's of what is found with that stiffness."""
    options = options or TableOptions()
    columns = zip(PAPER_2.by, PAPER_2.tumour, PAPER_2.normal, strict=True)
    cases = [(SHARE_2, mu, found, normal) for mu, found, normal in columns]
    return _table("table2", "tumour_mu_kpa", cases[:: options.every], PAPER_2.correlation, options, progress)


def _table(
    name: str, by: By, cases: list[tuple[float, float, float, float]], correlation: float, o: TableOptions, tell: Progress
) -> TumourTable:  # fmt: skip
    with one_thread():
        tell(0.0, "uniform organ")
        uniform = tumour_data(0.0, NORMAL_MU, o.data)
        fit = TumourFit(uniform.organ.rest, o.identify, o.element, o.data, progress=part(tell, 0.02, 0.4))
        fit.learn_meshes(uniform)
        rng = np.random.default_rng(o.seed)
        rows: list[TumourRow] = []
        for k, (share, mu, paper, paper_normal) in enumerate(cases):
            tell(0.4 + 0.6 * k / len(cases), f"tumour of {100 * share:.0f} %, {mu:g} kPa")
            row = _row(tumour_data(share, mu, o.data, energies=True), fit, fit.draw(rng, extraction=False)[0])
            rows.append({**row, "paper": {"tumour": paper, "normal": paper_normal}})
        bare = fit.identify_uneven(uniform)
    tell(1.0, "done")
    varied = [r[by] for r in rows]
    clean = [float(r["clean"]["mu_kpa"][0]) for r in rows]
    noisy = [float(r["noisy"]["mu_kpa"][0]) for r in rows]
    return {
        "study": name,
        "by": by,
        "noise_sd_mm": fit.sd_mm,
        "cells": o.identify.cells,
        "element": o.element,
        "data_cells": o.data.cells,
        "data_element": DATA_ELEMENT,
        "meshes_mm": fit.meshes_mm,
        "normal_mu_kpa": NORMAL_MU,
        "uniform": _told(bare),
        "rows": rows,
        "correlation": {"clean": _pearson(varied, clean), "noisy": _pearson(varied, noisy)},
        "paper_correlation": correlation,
        "rises": bool((np.diff(clean) > 0.0).all()),
        "largest_tumour_error_percent": max(abs(float(r["error_percent"][0])) for r in rows),
        "largest_normal_error_percent": max(abs(100.0 * (r["clean"]["mu_kpa"][1] / NORMAL_MU - 1.0)) for r in rows),
    }  # fmt: skip


def _row(data: TumourData, fit: TumourFit, error: FloatArray) -> _OursRow:
    clean, noisy = fit.identify_uneven(data), fit.identify_uneven(data, error)
    return {
        "share": data.share,
        "tumour_mu_kpa": data.tumour_mu,
        "effective_mu_kpa": data.effective_mu,
        "energy_in_place_mu_kpa": data.left.energy_in_place,
        "energy_of_its_surface_mu_kpa": data.left.energy_of_its_surface,
        "clean": _told(clean),
        "noisy": _told(noisy),
        "taken_as_uniform_mu_kpa": fit.identify(data).mu,
        "error_percent": 100.0 * (clean.mu / data.effective_mu - 1.0),
    }


def _told(found: Found) -> FoundHalves:
    return {
        "mu_kpa": found.mu, "ci95_kpa": found.interval, "sd_ln": found.posterior.sd, "uneven_sd_ln": found.uneven_sd,
    }  # fmt: skip


def _pearson(x: list[float], y: list[float]) -> float:
    return float(stats.pearsonr(x, y).statistic)
