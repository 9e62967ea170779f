"""Which contoured structure is which organ, by its name: one recogniser for every format."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping, Sequence

from palpate.core.errors import InputError
from palpate.imaging.contours import organ_words as words
from palpate.imaging.contours.structure_names import PARTIAL, label_named, meaning_of_name

ORGANS = ("prostate", "bladder", "rectum", "bone", "prostate_left", "prostate_right")
# Instead of a structure's name: none of them is the organ.
NONE = "none"
# Types of targets (RTROIInterpretedType): a prostate may be one.
TARGETS = ("CTV", "GTV")
# Names in a message or note.
SHOWN = 20


def plain(name: str) -> str:
    """A name as it is compared: one way of writing accents, single blanks, no case."""
    return " ".join(unicodedata.normalize("NFC", name).split()).casefold()


def distinct(names: Sequence[str], numbers: Sequence[int]) -> list[str]:
    """The names, followed by the file's own number where several are alike."""
    alike = [plain(name) for name in names]
    return [
        f"{name} #{number}" if alike.count(key) > 1 or not name else name
        for name, key, number in zip(names, alike, numbers, strict=True)
    ]


def choose_rois(
    names: Sequence[str],
    source: str,
    wanted: Mapping[str, Sequence[str]] | None = None,
    numbers: Mapping[str, int] | None = None,
    types: Mapping[str, str] | None = None,
) -> tuple[dict[str, list[str]], list[str]]:
    """The structures of each organ, organ -> names, and notes on those passed over.

    Organs are `ORGANS` and surrounding_tissue; an organ without a structure is left out. A plain name (Prostata) goes before one
    with additions (Prostate_DL). Several names for one organ are an error, except for bone, whose parts add up where none is named after
    all of it. So is an organ whose word stands beside words that are not known only (zProstate), or whose type is that of no organ.
    wanted : the caller's own choice, organ -> names, or the file's numbers of them, or `NONE`. numbers : name -> that number.
    types : name -> what the file says of it (ORGAN, PTV, ...: RTROIInterpretedType).

    Raises InputError listing the names where the choice is not clear, or a wanted name is not there.
    """
    types = types or {}
    chosen = _chosen_by_caller(names, source, wanted or {}, numbers or {})
    taken = {name for own in chosen.values() for name in own}
    notes: list[str] = []
    by_organ: dict[str, dict[str, list[str]]] = {}
    unclear: dict[str, dict[str, str]] = {}
    for name in names:
        meaning = meaning_of_name(name)
        if meaning.organ is None or name in taken:
            continue
        if reason := _doubt(meaning.unknown, types.get(name, "")):
            unclear.setdefault(meaning.organ, {})[name] = reason
        else:
            by_organ.setdefault(meaning.organ, {}).setdefault(meaning.additions, []).append(name)
    both_halves = "prostate" not in chosen and by_organ.keys() >= {"prostate_left", "prostate_right"}
    for organ, sets in by_organ.items():
        if organ in chosen or (organ.startswith("prostate_") and "prostate" in chosen and not both_halves):
            continue
        chosen[organ] = _the_one_set(organ, _typed_organ(sets, types), source)
        passed_over = [name for group in sets.values() for name in group if name not in chosen[organ]]
        passed_over += unclear.get(organ, {})
        left_out = f"; not used: {_listed(passed_over)}" if passed_over else ""
        said = [f"{name} is {types[name]} by its type" for name in chosen[organ] if types.get(name) in TARGETS]
        said += [f"{name} is by its {PARTIAL} a part of it" for name in chosen[organ] if PARTIAL in name]
        if passed_over or said or [label_named(name) for name in chosen[organ]] != [organ]:
            notes.append(f"{organ} is {' + '.join(chosen[organ])}{''.join(f' ({s})' for s in said)}{left_out}")
    _ask(unclear, chosen, source)
    return {organ: own for organ, own in chosen.items() if own}, notes


def _doubt(unknown: Sequence[str], kind: str) -> str:
    """Why a structure with an organ's word in its name may be something else; "" where nothing says so."""
    if unknown:
        return f"{', '.join(map(repr, unknown))} is not known"
    return f"its type is {kind}" if kind in words.NO_ORGAN_TYPES else ""


def _ask(unclear: Mapping[str, Mapping[str, str]], chosen: Mapping[str, Sequence[str]], source: str) -> None:
    """Raises InputError for an organ of which there are structures in doubt only. Bone has many parts, which may be left out."""
    for organ, told in unclear.items():
        halves = organ.startswith("prostate") and any(known.startswith("prostate") for known in chosen)
        if organ in chosen or halves or organ == "bone":
            continue
        shown = ", ".join(f"{name} ({reason})" for name, reason in list(told.items())[:SHOWN])
        raise InputError(
            f"{source} holds no plain {organ}, only {shown}; give --roi {organ}=NAME where it is the organ, else --roi {organ}={NONE}"
        )


def _typed_organ(sets: dict[str, list[str]], types: Mapping[str, str]) -> dict[str, list[str]]:
    """The sets without what is no ORGAN by its type, where another one is."""
    organs = {key: [name for name in group if types.get(name) == "ORGAN"] for key, group in sets.items()}
    targets = any(types.get(name) in TARGETS for group in sets.values() for name in group)
    return {key: group for key, group in organs.items() if group} if targets and any(organs.values()) else sets


def unused_note(names: Sequence[str], chosen: Mapping[str, Sequence[str]], notes: Sequence[str]) -> list[str]:
    """One note on the structures that no organ was made of and no other note names."""
    used = {name for own in chosen.values() for name in own}
    said = " ".join(note.partition("; not used: ")[2] for note in notes)
    unused = [name for name in names if name not in used and name not in said]
    return [f"not used: {_listed(unused)}"] if unused else []


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def _chosen_by_caller(
    names: Sequence[str], source: str, wanted: Mapping[str, Sequence[str]], numbers: Mapping[str, int]
) -> dict[str, list[str]]:
    chosen: dict[str, list[str]] = {}
    for organ, own in wanted.items():
        if organ not in ORGANS:
            raise InputError(f"--roi {organ} is no organ; known are {', '.join(ORGANS)}")
        chosen[organ] = [] if list(own) == [NONE] else _picked(list(own), names, numbers, source)
    return chosen


def _picked(own: list[str], names: Sequence[str], numbers: Mapping[str, int], source: str) -> list[str]:
    """The file's names that the caller's are. One with commas in it came as several, which are put together again."""
    found: list[str] = []
    at = 0
    while at < len(own):
        for end in range(len(own), at, -1):
            match = _named(",".join(own[at:end]), names, numbers)
            if match is not None:
                break
        else:
            raise InputError(f"{source} has no structure {own[at]!r}; it has {_listed(names)}; correct --roi")
        found.append(match)
        at = end
    return found


def _named(text: str, names: Sequence[str], numbers: Mapping[str, int]) -> str | None:
    if text in names:
        return text
    alike = [name for name in names if plain(name) == plain(text)]
    if len(alike) == 1:
        return alike[0]
    number = text.strip().removeprefix("#")
    if number.isascii() and number.isdigit():
        return next((name for name in names if numbers.get(name) == int(number)), None)
    return None


def _the_one_set(organ: str, sets: dict[str, list[str]], source: str) -> list[str]:
    plainest = [key for key in sets if not set(key.split()) - words.BESIDE_RECTUM]
    key = min(plainest or list(sets), key=len)
    clear = bool(plainest) or len(sets) == 1
    if not clear or (len(sets[key]) > 1 and organ != "bone"):
        choices = ", ".join(name for group in sets.values() for name in group)
        raise InputError(f"{source} has several structures for {organ}: {choices}; choose one with --roi {organ}=NAME")
    # A structure named after all bone holds its parts: femoral heads beside it, which may be balls, are drawn twice.
    return [name for name in sets[key] if organ == "bone" and label_named(name) == organ] or sets[key]
