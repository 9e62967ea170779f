"""What a diagnosis found, in words, and how that goes together with what the summary says of the misfit."""

from __future__ import annotations

from palpate.core.diagnose.diagnosis_record import DiagnosisRecord
from palpate.core.files.json_types import known
from palpate.ui.report.record import CaseRecord
from palpate.ui.report.regions import region_words
from palpate.ui.words.number_words import three_figures

VERDICTS = {"none": "no gap found", "ambiguous": "a gap, its cause not settled", "unknown": "a gap of unknown cause"}
GAP_TITLE = "What the model leaves out"
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


def diagnosis_sentence(record: CaseRecord) -> str:
    """The verdict of diagnosis.json in one sentence for the summary, and that it may differ from the misfit's."""
    found = record.diagnosis
    assert found is not None
    gap, verdict = found.gap, found.verdict
    p = chance(gap.p_value)
    if verdict == "none":
        said, doubt = f"found nothing that the model leaves out ({p})", ""
    else:
        said = f"found a gap ({gap.rms_mm:.2f} mm rms where noise would leave {gap.noise_floor_mm:.2f} mm, {p}), {_cause(found)}"
        doubt = " and may be a false alarm"
    other = (
        " Its own stiffness lies outside the intervals above; trust those above, why is said there."
        if _outside(record)
        else ""
    )
    return (
        f"The diagnosis {said}; it reads the noise from this pair itself and looks for patterns, so that its verdict may differ from "
        f"the sentence before{doubt}: see \N{LEFT DOUBLE QUOTATION MARK}{GAP_TITLE}\N{RIGHT DOUBLE QUOTATION MARK}.{other}"
    )


def two_noises(found: DiagnosisRecord, record: CaseRecord) -> str:
    """Why the summary and the diagnosis have different figures for the noise; empty where the summary has none."""
    sd, expected = record.noise_sd_mm, record.expected_misfit_mm
    if sd is None or expected is None:
        return ""
    own = known(found.gap.contour_noise_sd_mm)
    here = "" if own is None else f", here {own:.2f} mm"
    return (
        f"Why the noise here is not the Summary's: the Summary takes contours to repeat to {sd:.2f} mm ({record.noise_from}) and "
        f"compares the size of the whole misfit with what that would leave ({expected:.2f} mm). The diagnosis fits the model anew; "
        f"starts from the same figure but estimates from this pair how far its contours do wander{here}; adds what the walls' unknown "
        "motion along themselves, voxels and mesh leave; smooths over detail finer than contours hold; and asks whether what is "
        "left is too large for that noise or has a pattern that noise has not. So it can find a gap where the Summary's misfit is "
        "within its noise, and none where it is above."
    )


def two_stiffnesses(record: CaseRecord) -> str:
    """What the stiffness of a diagnosis is for, and which to trust where it does not fit the one that was identified.

    Empty where the page shows no stiffness of the diagnosis and there is nothing to warn of.
    """
    outside = _outside(record)
    if not outside and (record.diagnosis is None or record.diagnosis.stiffness.with_effect is None):
        return ""
    text = (
        "The diagnosis fits the stiffness anew, with a noise model and a motion of the walls of its own, to compare without and with "
        "an effect. The values to quote are the Summary's."
    )
    if not outside:
        return text
    return (
        f"{text} Its value without an effect lies outside the Summary's interval: {'; '.join(outside)}. Trust the Summary's: on simulated "
        "pairs of known stiffness 95 to 97 % of the intervals made in its way held the truth, while the fit here takes the noise from this "
        "one pair, and where it reads too little, voxels and walls pull the stiffness. But take the difference as a warning that how the "
        "surfaces are weighed changes this pair's stiffness by more than that interval says."
    )


def _outside(record: CaseRecord) -> list[str]:
    """Where the diagnosis' stiffness without an effect is not within the interval that was identified: both, in words."""
    without = {} if record.diagnosis is None else record.diagnosis.stiffness.without_effect
    return [
        f"{region_words(region.name, len(record.regions) == 1)}, {three_figures(without[region.name].G_kpa)} kPa, not "
        f"{three_figures(region.ci[0])} to {three_figures(region.ci[1])}"
        for region in record.regions
        if region.ci and region.name in without and not region.ci[0] <= without[region.name].G_kpa <= region.ci[1]
    ]


def _cause(found: DiagnosisRecord) -> str:
    verdict, names = found.verdict, [plain(name) for name in found.candidates]
    if verdict == "unknown":
        return "of unknown cause"
    if verdict != "ambiguous":
        return f"explained by {plain(verdict)}"
    listed = " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
    return "its cause not settled" + (f" (perhaps {listed})" if listed else "")
