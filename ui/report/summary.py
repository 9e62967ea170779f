"""The few sentences that a clinician reads in a minute."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from palpate.case.missing import AUTOMATIC_CONTOURS, at_bounds
from palpate.core.files.json_types import known
from palpate.core.inference.posterior import NOTHING
from palpate.ui.report.diagnosis_words import diagnosis_sentence, gap_is_seen
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.regions import RegionStiffness
from palpate.ui.words.number_words import three_figures

# About thirty independent looks at the surface: the rms misfit scatters by 13 %, and this is two of that.
MISFIT_TOLERANCE = 1.26
MISSING = "Missing: "
NOTHING_DETERMINED = "This pair does not determine the stiffness of the prostate."
WAY_OUT = (
    "Contours that a person or a trained model has drawn are the way to a stiffness: give them to `palpate analyze` with --rest-labels and "
    "--deformed-labels."
)
# Standard deviations between two stiffnesses that a pair tells apart: 95 %.
TELLING = 1.96


def stiffness_text(region: RegionStiffness) -> str:
    """``148 kPa (95 % interval 120 to 182)``."""
    if region.ci is None:
        return f"{three_figures(region.G)} kPa (error not known)"
    return (
        f"{three_figures(region.G)} kPa (95 % interval {three_figures(region.ci[0])} to {three_figures(region.ci[1])})"
    )


def summary(record: CaseRecord) -> list[str]:
    """What is missing, what was found, relative to what, on which error of the contours, and whether to believe it."""
    regions = [region for region in record.regions if region.determined]
    sentences = first_sentences(record)
    if too_rough(record):
        return [*sentences, diagnosis_sentence(record)] if record.diagnosis else sentences
    sentences += [_untold(region, record) for region in record.regions if not region.determined]
    sentences += [stands_on(record)] if regions else []
    if regions:
        G = record.facts.tissue_shear_modulus_kpa
        sentences.append(
            f"All stiffness is relative to the surrounding tissue, which was taken to have G = {G:g} kPa, not measured."
        )
    searches = record.result.agreement
    if searches and not searches.harmless:
        sentences.append(f"Doubtful: {searches.in_words}.")
    sentences.append(misfit_verdict(record))
    return [*sentences, diagnosis_sentence(record)] if record.diagnosis else sentences


def first_sentences(record: CaseRecord) -> list[str]:
    """What must be read first: that the pair tells nothing, what is missing; then what was found."""
    nothing = not any(region.determined for region in record.regions)
    sentences = [NOTHING_DETERMINED, *_why_nothing(record)] if nothing else []
    sentences += [f"{MISSING}{line}." for line in what_lacks(record)]
    sentences += [WAY_OUT] if too_rough(record) else []
    return sentences if nothing else [*sentences, headline(record)]


def _why_nothing(record: CaseRecord) -> list[str]:
    """The reason that the identification gives, as a sentence; none where it gives none."""
    says, _, why = record.result.identifiability.verdict.partition("; ")[0].partition(": ")
    return [f"{why[:1].upper()}{why[1:]}."] if says == NOTHING and why else []


def headline(record: CaseRecord) -> str:
    """What was found, in one sentence."""
    regions = [region for region in record.regions if region.determined]
    return _found(regions, record) if regions else NOTHING_DETERMINED


def too_rough(record: CaseRecord) -> bool:
    """Whether contours that were found automatically tell no stiffness by themselves: a misfit then says nothing of the model."""
    told = any(region.determined for region in record.regions)
    return (
        not told and not record.used_image and any(line.startswith(AUTOMATIC_CONTOURS) for line in what_lacks(record))
    )


def what_lacks(record: CaseRecord) -> list[str]:
    """What result.json says is missing, but for stiffness at a bound, which has a sentence of its own."""
    bounds = at_bounds(record.result.parameters)
    return [line for line in known(record.result.missing) or [] if line not in bounds]


def stands_on(record: CaseRecord) -> str:
    """Which error of the contours the intervals stand on, and whether on the images' motion too."""
    beside = " They also use the motion that both scans' images show." if record.used_image else ""
    return _contours_stood_on(record) + beside


def _contours_stood_on(record: CaseRecord) -> str:
    errors = known(record.result.contour_errors_mm)
    if not errors:
        stated = record.facts.boundary_noise_sd_mm
        sd = record.noise_sd_mm if stated is None else stated
        size = "an unknown error" if sd is None else f"an error of {sd:.2f} mm"
        return f"The intervals assume {size} of each contour, {record.noise_from}."
    names = {"organ": "prostate", "bladder": "bladder", "rectum": "rectum"}
    said = []
    for surface, name in names.items():
        each = [of_state[surface] for of_state in errors.values() if surface in of_state]
        if each:
            said.append(f"{name} {' and '.join(f'{mm:.1f}' for mm in each)} mm")
    return (
        f"The intervals assume contour errors estimated from the images: {', '.join(said)} rms. Contours of a person or a "
        "trained model are better."
    )


def misfit_verdict(record: CaseRecord) -> str:
    """Whether the model explains the deformed scan as well as the contours' own error allows."""
    misfit, expected = record.result.misfit, record.expected_misfit_mm
    rms = f"The model meets the deformed organ's surface to {misfit.rms_mm:.2f} mm rms"
    if expected is None:
        return f"{rms}; how repeatable the contours are is not known, so whether this is good enough is not either."
    sd = record.noise_sd_mm
    repeats = "" if sd is None else f" if contours repeat to {sd:.2f} mm, {record.noise_from}"
    size = f"{expected:.2f} mm expected{repeats}"
    if misfit.rms_mm > MISFIT_TOLERANCE * expected:
        return (
            f"{rms}, more than the contours' own error explains ({size}): something is left out of the model, and the stiffness "
            "may have absorbed it."
        )
    if gap_is_seen(record.diagnosis):
        return f"{rms}, no larger than the contours' own error would make it ({size})."
    return f"{rms}, which the contours' own error explains ({size})."


def tells_apart(record: CaseRecord) -> bool:
    """Whether the pair tells which region is the stiffest; True where there is nothing to tell apart."""
    regions = [region for region in record.regions if region.determined]
    if len(regions) < 2:
        return True
    soft, stiff = (f(regions, key=lambda region: region.G) for f in (min, max))
    sd = record.ln_ratio_sd(stiff, soft)
    return sd is None or float(np.log(stiff.G / soft.G)) >= TELLING * sd


def _found(regions: list[RegionStiffness], record: CaseRecord) -> str:
    if len(regions) == 1:
        return f"The shear modulus G of the {regions[0].words} is {stiffness_text(regions[0])}."
    soft, stiff = (f(regions, key=lambda region: region.G) for f in (min, max))
    values = f"shear modulus G = {stiffness_text(stiff)} against {stiffness_text(soft)}"
    ln_ratio, sd = float(np.log(stiff.G / soft.G)), record.ln_ratio_sd(stiff, soft)
    if sd is None:
        return f"The {stiff.words} came out stiffer than the {soft.words}: {values}; how certain this is is not known."
    if not tells_apart(record):
        return (
            f"This pair does not show which is stiffer, the {stiff.words} or the {soft.words}: "
            f"{values}; the difference is within the error. The {stiff.words} is the stiffer one with a chance of about "
            f"{_percent(ln_ratio / sd)} %, short of the 97.5 % asked for."
        )
    low, high = np.exp(ln_ratio - 1.96 * sd), np.exp(ln_ratio + 1.96 * sd)
    return (
        f"The {stiff.words} is {np.exp(ln_ratio):.1f} times as stiff as the {soft.words} "
        f"(95 % interval {low:.1f} to {high:.1f}): {values}."
    )


def _percent(sds: float) -> int:
    """The share of a normal distribution, in whole percent, that lies below so many standard deviations over its mean."""
    return round(100.0 * float(ndtr(sds)))


def _untold(region: RegionStiffness, record: CaseRecord) -> str:
    low, high = record.facts.organ_shear_modulus_bounds_kpa
    if region.at_bound:
        return (
            f"The {region.words} ended at the edge of what was allowed (G = {three_figures(region.G)} kPa of {low:g} to "
            f"{high:g}): it is no measurement, and may reflect something that the model leaves out."
        )
    return f"This pair does not determine the stiffness of the {region.words}: it is hardly better known than before the scans."
