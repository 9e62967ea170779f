"""The one place that reads a posterior from what the program wrote: everything else of a calibration is the same for any estimator."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

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


def posteriors_of(case: Path, result: str) -> dict[str, CutNormal]:
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
        raise InputError(f"{case / result} holds no stiffness; run `palpate diagnose {case}` again")
    return {
        name: CutNormal(float(np.log(of["G_kpa"])), float(of["sd_ln_G"]), float(low), float(high))
        for name, of in stiffness.items()
    }
