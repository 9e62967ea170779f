"""The stiffness map within the organ, in words."""

from __future__ import annotations

from collections.abc import Mapping

from palpate.core.files.json_types import known
from palpate.core.identify.result_record import MapRecord, PlaceRecord
from palpate.ui.report.regions import region_words
from palpate.ui.words.number_words import three_figures


def map_caption(facts: MapRecord, names: Mapping[str, object]) -> str:
    """What stands below the picture of the map. names : of the regions."""
    untold = 100.0 * (1.0 - facts.told_share_of_volume)
    return (
        f"The shear modulus within the organ: each half's own value and what the data say of deviations from it, on {facts.patches} "
        f"patches. Averaged over a half it is the half's value in the table. {_uniform(facts, names)}"
        "Outlined where a place differs significantly from most of its half: solid where stiffer, dashed where softer. "
        f"Hatched where the data say less of a deviation than the prior does: {untold:.0f} % of the organ; nothing is seen there but the "
        "half's value. Below: the factor within which the true value lies in two cases of three."
    )


def told_places(facts: MapRecord, names: Mapping[str, object]) -> str:
    """Which places differ from their half, or that none is told to. names : of the regions."""
    level = known(facts.level)
    if level is None:
        return ""
    found = known(facts.places)
    if not found:
        return (
            f"No place is significantly stiffer or softer than its half (asked: {100 * level:.0f} % for all places at once). That rules no "
            "focus out: most of 12 mm and less stay hidden."
        )
    each = "; ".join(_place(place, names) for place in found)
    return (
        f"Told to differ from most of its half ({100 * level:.0f} % for all places at once; outlined on the map): {each}. Size and value "
        "of such a place are blurred: a small stiff focus looks larger and less stiff."
    )


def _place(place: PlaceRecord, names: Mapping[str, object]) -> str:
    low, high = (three_figures(value) for value in place.ci95_kpa)
    where, most = region_words(place.half, len(names) == 1), "most" if place.sense == "stiffer" else "least"
    return (
        f"{where}, {three_figures(place.volume_cc)} cc {place.sense}, at {most} {three_figures(place.times)} times the half's value "
        f"({three_figures(place.G_kpa)} kPa, 95 % {low} to {high})"
    )


def _uniform(facts: MapRecord, names: Mapping[str, object]) -> str:
    each = [
        f"{region_words(name, len(names) == 1)} {100 * p:.0f} %"
        for name, p in (known(facts.uniform_probability) or {}).items()
    ]
    return f"Probability that a half has no deviation: {', '.join(each)}. " if each else ""
