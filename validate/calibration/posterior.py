"""The one place that reads a posterior from what the program wrote: everything else of a calibration is the same for any estimator."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

import numpy as np
from scipy.stats import norm, truncnorm

from palpate.case.case_folder import CaseFolder
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError


@dataclass(frozen=True)
class CutNormal:
    """A normal distribution of ln G, cut at its bounds. mean, sd : of the normal before it is cut."""

    mean: float
    sd: float
    low: float
    high: float

    def draws(self, count: int, rng: np.random.Generator) -> FloatArray:
        """(count,) independent draws."""
        return np.asarray(truncnorm.rvs(**self._shape, size=count, random_state=rng))

    def interval(self, level: float) -> tuple[float, float]:
        """The central interval of this probability."""
        a, b = truncnorm.ppf([0.5 - 0.5 * level, 0.5 + 0.5 * level], **self._shape)
        return float(a), float(b)

    def z(self, truth: float) -> float:
        """Where the truth lies, as a standard normal has the same probability below it: cut or not, N(0, 1) when all is right."""
        p = np.clip(truncnorm.cdf(truth, **self._shape), 1e-12, 1.0 - 1e-12)
        return float(norm.ppf(p))

    @property
    def _shape(self) -> dict[str, float]:
        """Arguments of `scipy.stats.truncnorm`."""
        a, b = ((bound - self.mean) / self.sd for bound in (self.low, self.high))
        return {"a": a, "b": b, "loc": self.mean, "scale": self.sd}


@dataclass(frozen=True)
class Tabulated:
    """A distribution of ln G by its quantiles. mean : the value reported. sd : root mean square about it.

    quantiles (g,) : ln G at equally spaced probabilities, without the ends. low, high : its bounds.
    """

    mean: float
    sd: float
    quantiles: FloatArray
    low: float
    high: float

    def draws(self, count: int, rng: np.random.Generator) -> FloatArray:
        """(count,) independent draws."""
        return np.interp(rng.random(count), *self._table)

    def interval(self, level: float) -> tuple[float, float]:
        """The central interval of this probability."""
        low, high = np.interp([0.5 - 0.5 * level, 0.5 + 0.5 * level], *self._table)
        return float(low), float(high)

    def z(self, truth: float) -> float:
        """See `CutNormal.z`."""
        probability, value = self._table
        return float(norm.ppf(np.clip(np.interp(truth, value, probability), 1e-3, 1.0 - 1e-3)))

    @property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Probabilities (g + 2,) and ln G there."""
        return np.linspace(0.0, 1.0, len(self.quantiles) + 2), np.hstack([self.low, self.quantiles, self.high])


Marginal = CutNormal | Tabulated


class _Region(TypedDict, total=False):
    """What is read of a region."""

    G_kpa: float
    sd_ln_G: float
    quantiles_kpa: list[float]


def posteriors_of(case: Path, result: str) -> dict[str, Marginal]:
    """Posterior of ln G (kPa) by region's name. result : "result.json", or "diagnosis.json": with the effect where one is reported.

    Raises InputError when the file holds no stiffness.
    """
    low, high = np.log(CaseFolder(case).facts.organ_shear_modulus_bounds_kpa)
    found = json.loads((case / result).read_text(encoding="utf-8"))
    if result == "diagnosis.json":
        stiffness = found["stiffness"].get("with_effect") or found["stiffness"].get("without_effect")
    else:
        stiffness = found.get("parameters")
    if not stiffness:
        raise InputError(f"{case / result} contains no stiffness; run `palpate diagnose {case}` again")
    return {name: _marginal(of, float(low), float(high)) for name, of in stiffness.items()}


def _marginal(of: _Region, low: float, high: float) -> Marginal:
    """Of one region as the file has it: by quantiles where it has them."""
    mean, sd, quantiles = float(np.log(of["G_kpa"])), float(of["sd_ln_G"]), of.get("quantiles_kpa")
    return Tabulated(mean, sd, np.log(quantiles), low, high) if quantiles else CutNormal(mean, sd, low, high)
