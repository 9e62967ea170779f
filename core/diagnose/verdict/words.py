"""Diagnosis in words: one sentence for a clinician, and the next measurement."""

from __future__ import annotations

import numpy as np

from palpate.core.diagnose.detection.location import residuals
from palpate.core.diagnose.verdict.bounds_reached import bounds_reached
from palpate.core.diagnose.verdict.judge import Diagnosis
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, NONE, UNKNOWN
from palpate.core.residual.contours_alone import misleading_contours
from palpate.core.statistics import rms

_MORE = "a deformed scan in which bladder or rectum moves the organ farther, or contours that err less"
_GENERAL = "another deformed scan with another bladder and rectum filling, and matched points inside the organ"


def sentence(diagnosis: Diagnosis) -> str:
    """Outcome of the diagnosis for a reader who knows stiffness, not statistics."""
    missed = f"{rms(np.concatenate(residuals(diagnosis.fit))):.2f} mm"
    told_by, organ = "contours", "organ"
    if not diagnosis.fit.organ_drawn:
        told_by, organ = "images", "organ, where the images put it,"
    verdict = diagnosis.verdict.verdict
    if verdict == NONE:
        return (
            f"The model meets the deformed {organ} to {missed}, as well as the {told_by} allow: nothing in these scans "
            f"says that it leaves anything out.{_grey(diagnosis)}{_unless(diagnosis)}"
        )
    said = {s.effect.id: s.effect.words for s in diagnosis.screened}
    if verdict == UNKNOWN:
        return (
            f"The model misses the deformed {organ} by {missed}, more than the noise that this pair itself "
            "shows, and nothing in the "
            "library explains it: the stiffness given here may be wrong."
        )
    if not diagnosis.verdict.candidates:
        return (
            "These scans tell neither the stiffness nor whether the model leaves anything out: "
            f"{diagnosis.verdict.why}."
        )
    words = [said[name] for name in diagnosis.verdict.candidates]
    if verdict == AMBIGUOUS:
        return (
            f"The model misses the deformed {organ} by {missed}, more than the noise that this pair itself shows. "
            + (f"It could be that {' or that '.join(words)}: these scans cannot tell." if len(words) > 1 else
               f"It may be that {words[0]}, but these scans do not settle it: {diagnosis.verdict.why}.")
        )  # fmt: skip
    return (
        f"The model misses the deformed {organ} by {missed}, more than the noise that this pair itself shows, "
        f"because {words[0]}{_stiffness_with(diagnosis)}"
    )


def _stiffness_with(diagnosis: Diagnosis) -> str:
    """Which stiffness is given beside a named cause."""
    if misleading_contours(diagnosis.fit):
        return (
            "; contours that err as much as these tell no stiffness, neither with this taken into account nor without."
        )
    return f"; the stiffness with this taken into account is given beside the one without.{_either_side(diagnosis)}"


def _grey(diagnosis: Diagnosis) -> str:
    """What that sentence is worth where the p-value and the probability of a cause do not agree; empty where they do."""
    p = diagnosis.verdict.posterior
    nothing = p.get(NONE, 1.0)
    if nothing >= 1.0 - nothing and diagnosis.test.p_value < diagnosis.rules.level:
        return (
            f" Noise alone seldom leaves as much (p = {diagnosis.test.p_value:.2g}), yet with every cause at its best, that nothing is "
            f"left out is more probable ({nothing:.2f})."
        )
    if nothing >= 1.0 - nothing or not diagnosis.screened:
        return ""
    likeliest = max(diagnosis.screened, key=lambda s: p.get(s.effect.id, 0.0))
    return (
        f" Yet the probability that it leaves something out is {1.0 - nothing:.2f}, most probably that {likeliest.effect.words} "
        f"({p.get(likeliest.effect.id, 0.0):.2f}): too little to call it a gap, too much to exclude one."
    )


def _either_side(diagnosis: Diagnosis) -> str:
    """What makes that stiffness so wide where the tissue has two stiffnesses; empty where it has one."""
    named = [s.effect for s in diagnosis.screened if s.effect.id in diagnosis.verdict.candidates]
    if not any(p.over_reference for effect in named for p in effect.parameters):
        return ""
    return (
        " Motion does not tell which of the two sides has the stated stiffness of the tissue: its interval covers both."
    )


def _unless(diagnosis: Diagnosis) -> str:
    """What that sentence is worth where a stiffness ended at a bound; empty where none did."""
    reached = list(bounds_reached(diagnosis.fit, diagnosis.fit.linearisation.theta, diagnosis.rules).values())
    if not reached:
        return ""
    whose = " and ".join(reached)
    return (
        f" But the stiffness of {whose} ends at the edge of what was allowed, where it may take the place of what the model leaves "
        "out: do not read this as a model without a gap."
    )


def next_measurement(diagnosis: Diagnosis) -> str | None:
    """Measurement to make next; None when nothing is open."""
    if diagnosis.verdict.verdict == NONE:
        return _MORE if _unless(diagnosis) else None
    settles = {s.effect.id: s.effect.settled_by for s in diagnosis.screened}
    if diagnosis.verdict.verdict == AMBIGUOUS and diagnosis.verdict.candidates:
        parts = [f"{settles[name]} (for {name.replace('_', ' ')})" for name in diagnosis.verdict.candidates]
        return "; or ".join(parts)
    if diagnosis.verdict.verdict == UNKNOWN:
        return _GENERAL
    return _MORE if not diagnosis.verdict.candidates else None
