"""What a diagnosis found, in words, and how that goes together with what the summary says of the misfit."""

from __future__ import annotations

from msgspec import UnsetType

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.ui.report.record import CaseRecord
from palpate.ui.words.number_words import three_figures

VERDICTS = {"none": "no gap found", "ambiguous": "a gap, its cause not settled", "unknown": "a gap of unknown cause"}
GAP_TITLE = "What the model leaves out"
_SEE = f"see \N{LEFT DOUBLE QUOTATION MARK}{GAP_TITLE}\N{RIGHT DOUBLE QUOTATION MARK}"
# What a verdict of none is worth where a stiffness ended at its bound.
_LITTLE = ", which says little where a stiffness ends at its bound"
FALSE_ALARMS = (
    "Pairs without any hidden effect can raise such an alarm too, and a cause can be named wrongly: docs/gap.md says how often that "
    "was seen."
)


def plain(name: str) -> str:
    """An effect's name as a person writes it."""
    return name.replace("_", " ").replace("-", " ")


def chance(p: float) -> str:
    """A p-value."""
    return "p below 0.001" if p < 0.001 else f"p = {p:.2g}"


def gap_is_seen(found: DiagnosisRecord | None) -> bool:
    """Whether there is a diagnosis and it says that something is left out."""
    return found is not None and found.verdict != "none"


def says_little(found: DiagnosisRecord) -> bool:
    """Whether it saw no gap, but has a measurement to make next: a stiffness ended at its bound, where it may hide one."""
    return found.verdict == "none" and bool(found.next_measurement)


def in_grey(found: DiagnosisRecord) -> bool:
    """Whether it saw no gap, but its p-value and the probability of a cause do not agree, which its own sentence says."""
    if found.verdict != "none" or isinstance(found.posterior, UnsetType):
        return False
    rules = DecisionRules() if isinstance(found.options, UnsetType) else found.options.decision_rules
    nothing = found.posterior["none"]
    return (found.gap.p_value < rules.level) == (nothing >= 1.0 - nothing)


def diagnosis_sentence(record: CaseRecord) -> str:
    """The verdict of diagnosis.json in one sentence for the summary, and that it may differ from the misfit's."""
    found = record.diagnosis
    assert found is not None
    gap, verdict = found.gap, found.verdict
    p = chance(gap.p_value)
    expected = record.expected_misfit_mm
    if verdict == "none":
        little = _LITTLE if says_little(found) else ""
        said, doubt = f"found nothing that the model leaves out ({p}{_of_none(found)}){little}", ""
        if expected is not None and record.result.misfit.rms_mm <= expected:
            return f"The diagnosis {said}: {_SEE}."
    elif not gap.detected and not found.candidates:
        said, doubt = "could not see whether the model leaves anything out, because these scans show too little", ""
    else:
        size = f"{gap.rms_mm:.2f} mm rms where noise would leave {gap.noise_floor_mm:.2f} mm"
        # The size alone would contradict the verdict where it is below the noise's: then the pattern is what was found.
        what = "gap" if gap.rms_mm > gap.noise_floor_mm else "pattern that noise would seldom make"
        said = f"found a {what} ({size}, {p}), {_cause(found)}"
        doubt = " and may be a false alarm"
    return (
        f"The diagnosis {said}. It looks for patterns, not for size alone, so its verdict may differ from the sentence before{doubt}: "
        f"{_SEE}."
    )


def _of_none(found: DiagnosisRecord) -> str:
    """How probable it is that nothing is left out; empty in records of earlier versions."""
    return "" if isinstance(found.posterior, UnsetType) else f"; probability of nothing {found.posterior['none']:.2f}"


def two_stiffnesses(record: CaseRecord) -> str:
    """What the two stiffnesses of a diagnosis are for; empty where the page shows none with an effect.

    Where the value without an effect is not the one that was identified, the sentence says why that can be.
    """
    found = record.diagnosis
    if found is None or found.stiffness.with_effect is None:
        return ""
    text = (
        "Without an effect the stiffness is that of the model as it is; with the effect it is the mean over all causes that may be it, "
        "by their probability: quote that one if you believe the cause."
    )
    if _is_the_summarys(record):
        return f"{text} The value without an effect is the Summary's: one fit gives both."
    return (
        f"{text} The value without an effect is not the Summary's, which was found with other options or by an earlier state of the "
        "program: run identify again with its usual options to compare."
    )


def _is_the_summarys(record: CaseRecord) -> bool:
    """Whether the diagnosis' stiffness without an effect is the one that was identified, to three figures."""
    without = {} if record.diagnosis is None else record.diagnosis.stiffness.without_effect
    both = [(region.G, without[region.name].G_kpa) for region in record.regions if region.name in without]
    return all(three_figures(a) == three_figures(b) for a, b in both)


def _cause(found: DiagnosisRecord) -> str:
    verdict, names = found.verdict, [plain(name) for name in found.candidates]
    if verdict == "unknown":
        return "of unknown cause"
    if verdict != "ambiguous":
        return f"explained by {plain(verdict)}"
    listed = " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
    return "its cause not settled" + (f" (perhaps {listed})" if listed else "")
