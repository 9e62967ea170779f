"""What the numbers of a label volume mean: by the names that a file gives them, by the caller's choice, or as in LABELS."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from palpate.core.errors import InputError
from palpate.imaging.contours.named_labels import PAINT_ORDER
from palpate.imaging.contours.roi_names import SHOWN, choose_rois, distinct
from palpate.imaging.labels import LABEL_VALUES, LABELS, ORGAN_LABELS

# What programs call a label by themselves, and what is no organ.
_BY_ITSELF = re.compile(r"(label|segment|region|roi)?[ _#-]*\d*", re.IGNORECASE)
_OUTSIDE = ("clear label", "outside", "background", "exterior")


@dataclass(frozen=True)
class Meaning:
    """values : file value -> value of LABELS; a number that is not in it is no label. chosen : organ -> names it was made of.

    dropped : the numbers that their names or the caller's choice take for no organ, with those names; they are outside.
    """

    values: dict[int, int]
    chosen: dict[str, list[str]]
    notes: tuple[str, ...] = ()
    dropped: Mapping[int, str] = field(default_factory=dict)

    @property
    def is_whole(self) -> bool:
        """Whether the prostate is one region, left and right yet to be told apart."""
        return "prostate" in self.chosen

    def keeping(self, present: Iterable[int]) -> Meaning:
        """The same, taking the dropped numbers among those present as outside, with a note."""
        gone = {number: name for number, name in self.dropped.items() if number in set(present)}
        shown = ", ".join(
            f"{name} ({number})" if name else f"label {number}" for number, name in list(gone.items())[:SHOWN]
        )
        notes = (*self.notes, f"not used: {shown}" + (f" and {len(gone) - SHOWN} more" if len(gone) > SHOWN else ""))
        return Meaning(self.values | dict.fromkeys(gone, 0), self.chosen, notes if gone else self.notes)


def meaning_of_names(
    names: Mapping[int, str], source: str, wanted: Mapping[str, Sequence[str]] | None = None
) -> Meaning:
    """What numbers mean by their names, value -> name. wanted : organ -> names or numbers, the caller's own choice.

    Raises InputError naming ``source`` when no name is an organ, or the choice is not clear.
    """
    outside = {value for value, name in names.items() if value == 0 or name.strip().lower() in _OUTSIDE}
    told = {value: " ".join(name.split()) for value, name in names.items() if value not in outside}
    if all(_BY_ITSELF.fullmatch(name) for name in told.values()):
        return meaning_of_numbers(source, wanted)
    shown = dict(zip(distinct(list(told.values()), list(told)), told, strict=True))
    chosen, notes = choose_rois(list(shown), source, wanted, shown)
    if not chosen:
        raise InputError(
            f"{source} names {', '.join(list(shown)[:20])}, none of them an organ that is known; name them with --roi ORGAN=NUMBER"
        )
    values = dict.fromkeys(outside, 0)
    values.update({shown[name]: PAINT_ORDER[organ] for organ, own in chosen.items() for name in own})
    unused = [name for name, value in shown.items() if value not in values and not _BY_ITSELF.fullmatch(name)]
    return Meaning(values, chosen, tuple(notes), {shown[name]: name for name in unused})


def meaning_of_numbers(source: str, wanted: Mapping[str, Sequence[str]] | None = None) -> Meaning:
    """What numbers mean that have no names: those of LABELS, or the caller's, organ -> numbers.

    A number of LABELS that stands for an organ which the caller gives other numbers is none. Raises InputError for names.
    """
    values = {value: value for value in LABELS}
    known = {**LABEL_VALUES, "prostate": ORGAN_LABELS[0]}
    mine: dict[int, int] = {}
    for organ, numbers in (wanted or {}).items():
        if organ not in known or not all(number.strip().isdecimal() for number in numbers):
            raise InputError(
                f"{source} has numbers, not names: give --roi ORGAN=NUMBER with ORGAN one of {', '.join(sorted(known))}"
            )
        mine.update({int(number): known[organ] for number in numbers})
    taken = set(mine.values()) | (set(ORGAN_LABELS) if "prostate" in (wanted or {}) else set())
    dropped = {value: "" for value in LABELS if value in taken and value not in mine}
    kept = {value: label for value, label in values.items() if value not in dropped}
    return Meaning(kept | mine, {organ: list(own) for organ, own in (wanted or {}).items()}, (), dropped)
