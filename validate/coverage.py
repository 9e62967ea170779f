"""Do the 95 % intervals hold the truth 95 times in 100? Many noisy pairs of known stiffness, at several levels of noise."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.inference.gauss_newton import gauss_newton
from palpate.core.inference.posterior import unknown
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, silent
from palpate.validate.paper.reduced_fit import ReducedFit
from palpate.validate.paper.tumour_data import DATA_DIVISIONS, DATA_ELEMENT, tumour_data
from palpate.validate.paper.tumour_fit import TumourFit
from palpate.validate.paper.tumour_scene import Divisions


class CoverageRow(TypedDict):
    """One noise level: share of intervals that hold the truth, of both halves (2,) apart too; rms of (found - truth) / sd of ln G."""

    noise_sd_mm: float
    covered: float
    covered_by_half: FloatArray
    standard_error: float
    score_rms: float
    median_width_ln_G: float
    called_not_identifiable: int
    of_these_spanning_what_was_allowed: int


class CoverageTable(TypedDict):
    """Rows of noise levels, `replicates` noisy pairs in each."""

    study: str
    replicates: int
    truths_mu_kpa: tuple[tuple[float, float], ...]
    cells: int
    element: str
    data_cells: int
    data_element: str
    rows: list[CoverageRow]


@dataclass(frozen=True)
class CoverageOptions:
    """replicates : of each noise level sds_mm, of one contour. truths : mu of left and right, kPa, taken in turn."""

    replicates: int = 200
    sds_mm: tuple[float, ...] = (0.2, 0.4, 0.8)
    truths: tuple[tuple[float, float], ...] = ((30.0, 70.0), (20.0, 20.0), (60.0, 25.0), (15.0, 100.0))
    identify: Divisions = field(default_factory=Divisions)
    data: Divisions = DATA_DIVISIONS
    element: str = "p2p1"
    seed: int = 1

    @classmethod
    def quick(cls, seed: int = 1) -> CoverageOptions:
        """Coarse meshes, fewer truths."""
        return cls(100, (0.2, 0.8), ((30.0, 70.0),), Divisions(2, 1, 1), Divisions(4, 1, 1), seed=seed)


def coverage(options: CoverageOptions | None = None, progress: Progress = silent) -> CoverageTable:
    """Rows of noise levels; `covered` is the share of intervals that hold the truth, both halves together."""
    o = options or CoverageOptions()
    with one_thread():
        data = []
        for k, (left, right) in enumerate(o.truths):
            progress(0.1 * k / len(o.truths), "pairs of known stiffness")
            data.append(tumour_data(0.0, left, o.data, left, right))
        fit = TumourFit(
            data[0].organ.rest, o.identify, o.element, o.data, progress=lambda f, m: progress(0.1 + 0.3 * f, m)
        )
        fits = [fit.of(d.organ.deformed) for d in data]
        rows = []
        for k, sd in enumerate(o.sds_mm):
            progress(0.4 + 0.6 * k / len(o.sds_mm), f"contours of {sd:g} mm error")
            fit.set_noise(sd)
            rows.append(_level(fit, fits, o))
    progress(1.0, "done")
    return {
        "study": "coverage",
        "replicates": o.replicates,
        "truths_mu_kpa": o.truths,
        "cells": o.identify.cells,
        "element": o.element,
        "data_cells": o.data.cells,
        "data_element": DATA_ELEMENT,
        "rows": rows,
    }


def _level(fit: TumourFit, fits: list[ReducedFit], o: CoverageOptions) -> CoverageRow:
    """One noise level."""
    rng = np.random.default_rng(o.seed)
    errors = fit.draw(rng, o.replicates)
    inside, scores, widths, blind, spans = [], [], [], 0, 0
    bounds = fit.scene.parameters.bounds
    for k, error in enumerate(errors):
        truth = np.log(4.0 * np.array(o.truths[k % len(fits)]))
        one = fit.of(fits[k % len(fits)].target, error)
        found = gauss_newton(one.linearise, bounds.mean(axis=1), bounds, tolerance=1e-3)
        assert found is not None  # a reduced model always answers
        posterior = one.posterior(found, bounds)
        low, high = np.log(posterior.interval()).T
        inside.append((low <= truth) & (truth <= high))
        scores.append((found.theta - truth) / posterior.sd)
        widths.append(high - low)
        untold = unknown(posterior)
        blind += int(untold.sum())
        spans += int(((high - low)[untold] > 0.8 * (bounds[:, 1] - bounds[:, 0])[untold]).sum())
    share = float(np.mean(inside))
    return {
        "noise_sd_mm": fit.sd_mm,
        "covered": share,
        "covered_by_half": np.mean(inside, axis=0),
        "standard_error": float(np.sqrt(share * (1.0 - share) / len(errors))),
        "score_rms": float(np.sqrt(np.mean(np.square(scores)))),
        "median_width_ln_G": float(np.median(widths)),
        "called_not_identifiable": blind,
        "of_these_spanning_what_was_allowed": spans,
    }
