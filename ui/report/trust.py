"""How sure a stiffness is, with its reasons, and what would have to be known for a better answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.case.missing import AUTOMATIC_CONTOURS
from palpate.case.step_records import OrganRecord
from palpate.case.surface_errors import CORRECTED
from palpate.core.problem import Facts
from palpate.segmentation.error_estimate import ErrorNumbers
from palpate.ui.report.diagnosis_words import gap_is_seen
from palpate.ui.report.document import Notice
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.regions import RegionStiffness
from palpate.ui.report.summary import MISFIT_TOLERANCE, MISSING, WAY_OUT, too_rough, what_lacks

# Words for how sure a value is, by the factor that its 95 % interval reaches on both sides. A convention of this report.
SURE = ((1.25, "high"), (1.5, "moderate"))
LOW, NONE = "low", "none"
SURE_RULE = (
    "How sure: by the factor that the 95 % interval reaches to both sides. high: up to 1.25; moderate: up to 1.5; low: more; none: the "
    "scans cannot determine it. One word lower where the model misses the surface by more than the contours' own error. Low "
    "where nobody has drawn or checked a contour of the prostate: on real anatomy such a contour is often a third too large or too small."
)
# Methods of segmentation.json by which a person drew a contour.
_BY_HAND = ("user", "drawn", CORRECTED)
_OF_THE_ORGAN = " of the prostate"


@dataclass(frozen=True)
class Trust:
    """word : "high", "moderate", "low" or "none", by `SURE_RULE`. interval : how far the interval reaches, in words.

    lowered : why the word is not the interval's, a sentence each.
    """

    word: str
    interval: str
    lowered: tuple[str, ...] = ()


def trust(region: RegionStiffness, record: CaseRecord) -> Trust:
    """How sure one region's stiffness is: from its interval, the misfit and the origin of the contours."""
    if not region.determined:
        return Trust(NONE, "the scans cannot determine it")
    factor = np.inf if region.ln_sd is None else float(np.exp(1.96 * region.ln_sd))
    place = next((k for k, (most, _) in enumerate(SURE) if factor <= most), len(SURE))
    lowered = []
    if misses(record):
        place += 1
        lowered.append("One word lower: the model misses the surface by more than the contours' own error.")
    if unchecked(record):
        place = len(SURE)
        lowered.append("Low: the prostate's contours were found automatically and nobody has checked them.")
    words = [word for _, word in SURE] + [LOW]
    reaches = "interval not known" if region.ln_sd is None else f"95 % interval within a factor of {factor:.2f}"
    return Trust(words[min(place, len(SURE))], reaches, tuple(lowered))


def how_sure(region: RegionStiffness, record: CaseRecord) -> str:
    """ "high", "moderate", "low" or "none", by `SURE_RULE`."""
    return trust(region, record).word


def trust_box(record: CaseRecord) -> Notice:
    """The box of the first page: how sure each region is, and why."""
    each = [(region.words.removesuffix(_OF_THE_ORGAN), trust(region, record)) for region in record.regions]
    lines = [f"How sure, {words}: {one.word} ({one.interval})." for words, one in each]
    lines += dict.fromkeys(text for _, one in each for text in one.lowered)
    lines += [f"{MISSING}{line}." for line in what_lacks(record) if line not in automatic(record)]
    return Notice("\n".join([*lines, *[WAY_OUT] * too_rough(record)]))


def automatic(record: CaseRecord) -> list[str]:
    """The line of result.json that nobody drew the prostate, where nobody has corrected it since; else nothing."""
    lines = [line for line in what_lacks(record) if line.startswith(AUTOMATIC_CONTOURS)]
    return lines if unchecked(record) else []


def misses(record: CaseRecord) -> bool:
    """Whether the model misses the surface by more than the contours' own error, by the misfit or the diagnosis."""
    expected = record.expected_misfit_mm
    large = expected is not None and record.result.misfit.rms_mm > MISFIT_TOLERANCE * expected
    return large or gap_is_seen(record.diagnosis)


def unchecked(record: CaseRecord) -> bool:
    """Whether the program segmented the scans and a person drew the prostate in neither."""
    methods = [organs["prostate"]["method"] for organs in _organs(record) if "prostate" in organs]
    return bool(methods) and not set(methods) & set(_BY_HAND)


def missing(record: CaseRecord) -> list[str]:
    """What would have to be known for a better answer, every assumed error among it, one line each."""
    lines = []
    if record.diagnosis is None:
        lines.append("whether the model leaves something out: Diagnose has not been run")
    if unchecked(record):
        lines += automatic(record) or ["contours that a person has drawn or checked: these were found automatically"]
    return lines + _assumed(record)


def _assumed(record: CaseRecord) -> list[str]:
    """Errors that were assumed or estimated and not measured."""
    G, numbers = record.facts.tissue_shear_modulus_kpa, ErrorNumbers()
    estimated, lines = record.noise_from.startswith("estimated"), []
    if record.noise_from.startswith("assumed"):
        lines.append("how repeatable the contours are: assumed; draw them twice and it is measured")
    if estimated:
        lines.append(
            "how repeatable the contours are: estimated from the images; draw them by hand twice and it is measured"
        )
    if estimated and not record.carried_over:
        lines.append(
            f"what the errors of the two scans' contours have in common: assumed, {100.0 * numbers.common_share:.0f} % of their variance"
        )
    length = numbers.correlation_mm if estimated else Facts(G).noise_correlation_mm
    lines.append(f"over which distance the errors of a contour go together: assumed, {length:g} mm")
    return [*lines, f"the stiffness of the surrounding tissue: assumed, G = {G:g} kPa; every value is relative to it"]


def _organs(record: CaseRecord) -> list[dict[str, OrganRecord]]:
    return [dict(facts.get("organs", {})) for facts in record.segmentation.get("states", {}).values()]
