"""Verdicts, and the model checks that a name alone must pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from palpate.core.diagnose.posterior import NONE, UNKNOWN

AMBIGUOUS = "ambiguous"

__all__ = ["AMBIGUOUS", "NONE", "UNKNOWN", "ModelCheck", "Verdict"]


@dataclass(frozen=True)
class ModelCheck:
    """Whether the data look like what the leading hypothesis says of them. name, sentence : what is wrong where they do not.

    p_value : how often the hypothesis itself leaves as much; 0 for what its name excludes.
    """

    name: str
    p_value: float
    sentence: str


@dataclass(frozen=True)
class Verdict:
    """verdict and candidates as in diagnosis.json; probability of each cause and of "unknown", given a gap; why, in words.

    decided_by : name of the reason that decided. posterior : probability of every hypothesis, "none" among them; they sum to 1.
    """

    verdict: str
    candidates: tuple[str, ...]
    probability: Mapping[str, float]
    why: str
    decided_by: str
    posterior: Mapping[str, float] = field(default_factory=dict)
