"""How evidence is weighed before a verdict: the numbers of gap test, refits, and prediction of what was left out, each
with its source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from palpate.core.sourced_number import sourced

_COST = (
    "Chosen; saves time. Loosened with the others of its kind (twice as many and more), it changes neither verdict "
    "nor probability of "
    "shared case 310, the one it was tried on (tests/benchmarks/chosen_numbers.py)."
)


@dataclass(frozen=True, kw_only=True)
class EvidenceRules:
    """Numbers of gap test, evidence, refits, and prediction of what was left out."""

    level: Annotated[
        float,
        sourced(
            "1",
            "A gap is detected when noise alone leaves as much in fewer cases than this share, and a cause is more probable than none.",
            "Convention; the blind check asks for 5 % false alarms. Measured: 1 of 16 effect-free cases (docs/gap.md).",
        ),
    ] = 0.05
    draws: Annotated[
        int,
        sourced(
            "1",
            "Draws of noise that a p-value is counted from, and of the share by which the gap shrinks.",
            "Numerical: p = 0.05 to a standard error of 0.007, p = 0.01 to 0.003.",
        ),
    ] = 1000
    refit_share: Annotated[
        float,
        sourced(
            "1",
            "Share of the false alarms that the Bayes factor after refits may make.",
            "Chosen: the smaller of two p-values is paid for (Bonferroni), mostly by the one that is exact.",
        ),
    ] = 0.1
    clear: Annotated[
        float,
        sourced(
            "1",
            "No effect is refitted where the first look's p-value is above this.",
            "Chosen; saves time. Refits of 55 effect-free cases of the blind check's seed 15 gained at most 2.7 in "
            "the logarithm, 0.05 "
            "in the median.",
        ),
    ] = 0.3
    prior_nothing: Annotated[
        float,
        sourced(
            "1",
            "Prior probability that the plain model leaves nothing out.",
            "Chosen: even odds. A gap needs a cause that is more probable than none.",
        ),
    ] = 0.5
    prior_pair: Annotated[
        float,
        sourced(
            "1",
            "Share of the named causes' prior that all pairs of effects have together.",
            "Chosen: one cause in ten is two.",
        ),
    ] = 0.1
    prior_unknown: Annotated[
        float,
        sourced(
            "1",
            "Prior probability, once there is a gap, that no effect of the library causes it.",
            "Chosen: as likely as any three of its twelve. Equals the share of all cases of the blind check that "
            "have an effect outside "
            "the library (validate/blind/recipes.py; a quarter of those with any effect), so that the check flatters "
            "it.",
        ),
    ] = 0.2
    hopeless: Annotated[
        float,
        sourced(
            "ln",
            "Effects whose evidence is further below the best one's are neither refitted nor corrected for their own element error.",
            _COST,
        ),
    ] = 12.0
    at_most: Annotated[
        int,
        sourced(
            "1",
            "Variants of an effect, pairs of effects, and effects with their own element error: refitted at most.",
            _COST,
        ),
    ] = 3
    variants_within: Annotated[
        float, sourced("ln", "How close to the best variant's evidence they must be to be refitted.", _COST)
    ] = 3.0
    pair_worth: Annotated[
        float,
        sourced(
            "1", "A pair is refitted where, linear about the plain fit, it has this share of the probability.", _COST
        ),
    ] = 0.02
    near_mm: Annotated[
        float,
        sourced(
            "mm",
            "Motion is predicted this near to the organ's surface.",
            "Asked for: what matters lies within 15 mm of it.",
        ),
    ] = 15.0
    point_spacing_mm: Annotated[
        float,
        sourced(
            "mm",
            "Distance of the organ's points that are predicted.",
            "Numerical: under a correlation length of the noise.",
        ),
    ] = 4.0
    placebos: Annotated[
        int, sourced("1", "Placebos whose median gain is told beside that of the effect.", "Numerical.")
    ] = 40
