"""The paper's Tables 1 and 2: a half with a tumour of growing size, then of growing stiffness; what is found beside what it has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from palpate.core.identify.gauss_newton import gauss_newton
from palpate.core.observe.distance_field import SignedDistanceField
from palpate.core.validate.tumour_data import DATA_DIVISIONS, DATA_ELEMENT, TumourData, tumour_data
from palpate.core.validate.tumour_fit import Found, TumourFit
from palpate.core.validate.tumour_scene import NORMAL_MU, TUMOUR_MU, Divisions, DrivenScene, halved_ball
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent

FloatArray = NDArray[np.float64]


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


def table1(options: TableOptions | None = None, progress: Progress = silent) -> dict[str, Any]:
    """Rows of growing tumour; `correlation` is Pearson's of what is found with the tumour's share."""
    options = options or TableOptions()
    columns = zip(PAPER_1.by, PAPER_1.tumour, PAPER_1.normal, strict=True)
    cases = [(share, TUMOUR_MU, found, normal) for share, found, normal in columns]
    return _table("table1", "share", cases[:: options.every], PAPER_1.correlation, options, progress)


def table2(options: TableOptions | None = None, progress: Progress = silent) -> dict[str, Any]:
    """Rows of growing tumour stiffness at `SHARE_2` of the half; `correlation` is Pearson's of what is found with that stiffness."""
    options = options or TableOptions()
    columns = zip(PAPER_2.by, PAPER_2.tumour, PAPER_2.normal, strict=True)
    cases = [(SHARE_2, mu, found, normal) for mu, found, normal in columns]
    return _table("table2", "tumour_mu_kpa", cases[:: options.every], PAPER_2.correlation, options, progress)


def _table(
    name: str, by: str, cases: list[tuple[float, float, float, float]], correlation: float, o: TableOptions, tell: Progress
) -> dict[str, Any]:  # fmt: skip
    with one_thread():
        tell(0.0, "uniform organ")
        uniform = tumour_data(0.0, NORMAL_MU, o.data)
        fit = TumourFit(uniform.organ.rest, o.identify, o.element, o.data, progress=_part(tell, 0.02, 0.4))
        same = SameSurface(fit, o.data)
        rng = np.random.default_rng(o.seed)
        rows = []
        for k, (share, mu, paper, paper_normal) in enumerate(cases):
            tell(0.4 + 0.6 * k / len(cases), f"tumour of {100 * share:.0f} %, {mu:g} kPa")
            row = _row(tumour_data(share, mu, o.data), fit, same, fit.draw(rng, extraction=False)[0])
            rows.append(row | {"paper": {"tumour": paper, "normal": paper_normal}})
        bare = fit.identify(uniform)
    tell(1.0, "done")
    found = {key: [float(r[key]["mu_kpa"][0]) for r in rows] for key in ("clean", "noisy")}
    return {
        "study": name,
        "by": by,
        "noise_sd_mm": fit.sd_mm,
        "cells": o.identify.cells,
        "element": o.element,
        "data_cells": o.data.cells,
        "data_element": DATA_ELEMENT,
        "normal_mu_kpa": NORMAL_MU,
        "uniform": _told(bare),
        "rows": rows,
        "correlation": {key: _pearson([r[by] for r in rows], values) for key, values in found.items()},
        "paper_correlation": correlation,
        "rises": bool((np.diff(found["clean"]) > 0.0).all()),
        "largest_normal_error_percent": max(abs(100.0 * (r["clean"]["mu_kpa"][1] / NORMAL_MU - 1.0)) for r in rows),
    }  # fmt: skip


def _row(data: TumourData, fit: TumourFit, same: SameSurface, error: FloatArray) -> dict[str, Any]:
    clean, noisy = fit.identify(data), fit.identify(data, error)
    surface = same.of(data, clean)
    return {
        "share": data.share,
        "tumour_mu_kpa": data.tumour_mu,
        "effective_mu_kpa": data.effective_mu,
        "same_surface_mu_kpa": surface,
        "clean": _told(clean),
        "noisy": _told(noisy),
        "error_percent": 100.0 * (clean.mu / data.effective_mu - 1.0),
        "error_of_same_surface_percent": 100.0 * (clean.mu / surface - 1.0),
    }


class SameSurface:
    """Which uniform halves, on the generator's own mesh and element, move the organ's surface most alike: what a person who
    had no discretisation error would find."""

    def __init__(self, fit: TumourFit, data: Divisions) -> None:
        self.fit, self.scene = fit, DrivenScene(halved_ball(data), DATA_ELEMENT)
        self._operator = self.scene.space.interpolation(fit.points, (1, 2))

    def of(self, data: TumourData, near: Found) -> FloatArray:
        """mu (2,) kPa, searched from `near`; nan where no uniform half has an equilibrium."""
        target = SignedDistanceField.from_surface(data.organ.deformed.points, data.organ.deformed.faces)
        weighting, points = self.fit.weighting, self.fit.points

        def linearise(theta: FloatArray) -> tuple[FloatArray, FloatArray] | None:
            found = self.scene.solve(theta)
            if not found.converged:
                return None
            slopes = np.stack([self._operator @ s for s in self.scene.displacement_sensitivities(theta, found)])
            distance, normal = target.value_and_gradient(points + self._operator @ found.u)
            both = weighting.whiten(np.column_stack([distance, np.einsum("tqi,qi->qt", slopes, normal)]))
            return both[:, 0], both[:, 1:]

        end = gauss_newton(linearise, near.fit.theta, self.fit.scene.parameters.bounds, tolerance=5e-3)
        return np.full(2, np.nan) if end is None else np.exp(end.theta) / 4.0


def _told(found: Found) -> dict[str, Any]:
    return {"mu_kpa": found.mu, "ci95_kpa": found.interval, "sd_ln": found.posterior.sd}


def _pearson(x: list[float], y: list[float]) -> float:
    return float(stats.pearsonr(x, y).statistic)


def _part(tell: Progress, start: float, end: float) -> Callable[[float, str], None]:
    return lambda fraction, message: tell(start + (end - start) * fraction, message)
