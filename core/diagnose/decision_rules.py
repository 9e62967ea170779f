"""What a verdict needs and what is told of it: the numbers that decide, each with its source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from palpate.core.diagnose.evidence_rules import EvidenceRules
from palpate.core.sourced_number import sourced

_FLAG = "Chosen; only a line of words hangs on it."
_PEAK = "Chosen; the place that is pointed at hangs on it, no verdict. Measured as a whole: 1 mm from the true place."


@dataclass(frozen=True, kw_only=True)
class DecisionRules(EvidenceRules):
    """Levels, thresholds, minimum gains, priors of evidence, and draws: what decides a diagnosis."""

    sure: Annotated[
        float,
        sourced(
            "1",
            "The answer is the fewest hypotheses that hold this share of the probability.",
            "Chosen: one answer in ten may lack the cause.",
        ),
    ] = 0.9
    check_level: Annotated[
        float,
        sourced(
            "1",
            "A name alone may not leave a remainder, or data left out, that it would leave itself in fewer cases than this share.",
            "Convention: a model check, no test for a cause.",
        ),
    ] = 0.01
    most_candidates: Annotated[
        int, sourced("1", "Names in an ambiguous verdict, at most.", "Chosen: more would say nothing; scored as a set.")
    ] = 3
    step_share: Annotated[
        float,
        sourced(
            "1",
            "Where a step between slices explains more of what one rigid motion leaves of bones, they did not move as one.",
            "Chosen: more than all else together. Set with two blind cases of shifted slices (0.66, 0.71) and two of bones "
            "that moved (0.14, 0.22) in view. Drawn with errors: tests/benchmarks/slice_steps.py.",
        ),
    ] = 0.5
    step_mm: Annotated[
        float,
        sourced(
            "mm",
            "The least such step.",
            "Chosen: five times the error of a bone's surface, `EXTRACTION_MM` (core/observe/contour_noise.py).",
        ),
    ] = 1.0
    peak_share: Annotated[float, sourced("1", "Forces above this share of the largest one are pointed at.", _PEAK)] = (
        0.7
    )
    at_bound: Annotated[float, sourced("ln G", "A stiffness this close to a bound is flagged.", _FLAG)] = 0.05
    coarse_mm: Annotated[
        float,
        sourced(
            "mm rms",
            "A better element that moves the organ's surface by more flags the mesh as too coarse; with an effect it is "
            "then taken over only where the data prefer it.",
            "Chosen for the flag, on which only words hang. That it also decides which element stands came after one blind case "
            "(seed 2102) whose elements are 0.55 mm apart; eight fresh ones (seed 2104) had none so far apart.",
        ),
    ] = 0.35
    bench_unnamed_mm: Annotated[
        float, sourced("mm", "What an effect that nobody has thought of would do to the markers of a bench.", "Chosen.")
    ] = 2.0
