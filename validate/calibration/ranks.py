"""Simulation-based calibration (Talts, Betancourt, Simpson, Vehtari & Gelman 2018): ranks of the truth, intervals, errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict

import numpy as np
from scipy.stats import binomtest, chisquare

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.statistics import rms
from palpate.validate.calibration.posterior import Marginal

# Draws of a posterior among which the truth has its rank, and bins of the ranks: their number divides DRAWS + 1, so that all are alike.
# A bin shall hold this many cases at least.
DRAWS, BINS, PER_BIN = 99, (20, 10, 5, 4, 2), 5.0
LEVELS = (0.5, 0.8, 0.95)


class IntervalRow(TypedDict):
    """Share of the central intervals of a level that hold the truth, and its exact 95 % interval (Clopper & Pearson 1934)."""

    level: float
    holds: float
    low: float
    high: float


class Calibration(TypedDict):
    """chi_square_p : of ranks (counts by bin) against uniform ones, None for too few cases. z_mean, z_rms : of the truth's place in the
    posterior as a standard normal's; 0 and 1 when all is right, each with the standard error that many cases give. sd_ln_G : median.
    """

    cases: int
    ranks: list[int]
    chi_square_p: float | None
    intervals: list[IntervalRow]
    z_mean: float
    z_mean_error: float
    z_rms: float
    z_rms_error: float
    mean_error_ln_G: float
    sd_ln_G: float


def rank(posterior: Marginal, truth: float, rng: np.random.Generator) -> int:
    """How many of DRAWS draws lie below the truth, 0 to DRAWS."""
    return int((posterior.draws(DRAWS, rng) < truth).sum())


def calibration(pairs: Sequence[tuple[Marginal, float, int]]) -> Calibration:
    """Figures of posteriors, true ln G and the truths' ranks. The cases must be independent: one region of each patient."""
    n = len(pairs)
    counts, p = uniformity(np.array([r for _, _, r in pairs], dtype=np.int64))
    z = np.array([posterior.z(truth) for posterior, truth, _ in pairs])
    return {
        "cases": n,
        "ranks": counts.tolist(),
        "chi_square_p": p,
        "intervals": [_interval(pairs, level) for level in LEVELS],
        "z_mean": float(z.mean()),
        "z_mean_error": float(1.0 / np.sqrt(n)),
        "z_rms": rms(z),
        "z_rms_error": float(1.0 / np.sqrt(2.0 * n)),
        "mean_error_ln_G": float(np.mean([posterior.mean - truth for posterior, truth, _ in pairs])),
        "sd_ln_G": float(np.median([posterior.sd for posterior, _, _ in pairs])),
    }


def uniformity(ranks: IntArray) -> tuple[IntArray, float | None]:
    """Counts of ranks by bin, and the chi-square p-value against all bins alike; as many bins as the cases fill."""
    filled = [bins for bins in BINS if len(ranks) >= PER_BIN * bins]
    bins = filled[0] if filled else BINS[-1]
    counts = np.bincount(ranks * bins // (DRAWS + 1), minlength=bins)
    return counts, float(chisquare(counts).pvalue) if filled else None


def _interval(pairs: Sequence[tuple[Marginal, float, int]], level: float) -> IntervalRow:
    ends = np.array([posterior.interval(level) for posterior, _, _ in pairs])
    truths: FloatArray = np.array([truth for _, truth, _ in pairs])
    inside = int(((ends[:, 0] <= truths) & (truths <= ends[:, 1])).sum())
    told = binomtest(inside, len(pairs)).proportion_ci(0.95)
    return {"level": level, "holds": inside / len(pairs), "low": float(told.low), "high": float(told.high)}


def by_region(
    posteriors: Mapping[str, Marginal], truths: Mapping[str, float], rng: np.random.Generator
) -> dict[str, tuple[Marginal, float, int]]:
    """Posterior, true ln G and its rank of every region that both have."""
    return {
        name: (posterior, truths[name], rank(posterior, truths[name], rng))
        for name, posterior in posteriors.items()
        if name in truths
    }
