"""The stiffness of one region as result.json gives it, and whether it says anything."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from palpate.case.case_facts import CaseFacts
from palpate.core.identify.result_record import RegionRecord, ResultRecord
from palpate.core.inference.posterior import as_before
from palpate.imaging.labels import LABEL_VALUES


@dataclass(frozen=True)
class RegionStiffness:
    """One region of result.json: G, sd, mu in kPa; ci is the 95 % interval. None where unknown.

    words : the name as a person says it.
    determined : whether the pair determines this stiffness at all: not at a bound, and known better than before the scans.
    """

    name: str
    words: str
    G: float
    sd: float | None
    ci: tuple[float, float] | None
    mu1: float
    mu2: float
    mu_mean: float
    at_bound: bool
    determined: bool

    @property
    def label(self) -> int:
        """The label's value; 0 for a name that is no label."""
        return LABEL_VALUES.get(self.name, 0)

    @property
    def ln_sd(self) -> float | None:
        """Standard deviation of ln G, from the interval; None where unknown."""
        if self.ci is None:
            return None if self.sd is None else self.sd / self.G
        return float(np.log(self.ci[1] / self.ci[0]) / (2.0 * 1.96))


def region_of(name: str, p: RegionRecord, facts: CaseFacts, alone: bool) -> RegionStiffness:
    """A region of result.json by its name and entry. alone : it is the organ's only one."""
    ci = p.ci95_kpa
    low, high = facts.organ_shear_modulus_bounds_kpa
    found = RegionStiffness(
        name, region_words(name, alone), p.G_kpa, p.sd_kpa, ci, p.mu1_kpa, p.mu2_kpa, p.mu_mean_kpa, p.at_bound, not p.at_bound
    )  # fmt: skip
    nothing_new = found.ln_sd is not None and as_before(np.array([found.ln_sd]), np.log([[low, high]]))[0]
    return replace(found, determined=False) if nothing_new else found


def regions_of(result: ResultRecord, facts: CaseFacts) -> tuple[RegionStiffness, ...]:
    """The regions of result.json, in the order of their labels."""
    found = [region_of(name, p, facts, len(result.parameters) == 1) for name, p in result.parameters.items()]
    return tuple(sorted(found, key=lambda region: region.label))


def in_words(text: str, names: Iterable[str]) -> str:
    """A text of another step with its regions called as everywhere in the report. names : of result.json's regions."""
    known = list(names)
    for name in known:
        text = text.replace(name.replace("_", " "), region_words(name, len(known) == 1))
    return text


def region_words(name: str, alone: bool = False) -> str:
    """``prostate_left`` as a person says it: left half of the prostate; where it stands alone, the whole prostate."""
    organ, _, side = name.rpartition("_")
    if not organ or side not in ("left", "right"):
        return name.replace("_", " ")
    return organ if alone else f"{side} half of the {organ}"
