"""Which contoured structure is which organ, by its name: one recogniser for every format."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from functools import lru_cache

from palpate.core.errors import InputError
from palpate.imaging.contours import organ_words as words
from palpate.imaging.labels import LABEL_VALUES

ORGANS = ("prostate", "bladder", "rectum", "bone", "prostate_left", "prostate_right")
# Names in a message or note.
SHOWN = 20
# Two structures of one name are told apart by the file's own numbers, which are no part of the name.
_NUMBERED = re.compile(r" #\d+$")
_GLUE = {
    **{word: organ for organ, known in words.ORGAN_WORDS.items() for word in known},
    **dict.fromkeys(words.NEUTRAL_WORDS | words.NEUTRAL_BESIDE_BONE | words.BESIDE_RECTUM, ""),
    **dict.fromkeys(words.DERIVED_WORDS, ""),
}
_SIDES_IN_GLUE = words.LEFT | words.RIGHT
_SHORTEST_GLUED = 3


def plain(name: str) -> str:
    """A name as it is compared: one way of writing accents, single blanks, no case."""
    return " ".join(unicodedata.normalize("NFC", name).split()).casefold()


def words_of(name: str) -> list[str]:
    """A structure's name as words: lower case, no accents, split at signs, digits, CamelCase and where known words are glued."""
    composed = unicodedata.normalize("NFKD", _NUMBERED.sub("", name).replace("ß", "ss"))
    text = composed.encode("ascii", "ignore").decode()
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", text)
    found = re.findall(r"[a-z]+|\d+", parted.lower())
    return [part for word in found for part in _unglued(word)]


def label_named(name: str) -> str | None:
    """The label that a name is, whatever its case, blanks and dashes; None when it is none."""
    key = re.sub(r"[\s_-]+", "_", name.strip().lower())
    return key if LABEL_VALUES.get(key) else None


def organ_of(name: str) -> str | None:
    """The organ that a structure's name stands for; None when it is none of ours."""
    return _meaning(name)[0]


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
) -> tuple[dict[str, list[str]], list[str]]:
    """The structures of each organ, organ -> names, and notes on those passed over.

    Organs are `ORGANS` and surrounding_tissue; an organ without a structure is left out. A plain name (Prostata) goes before one
    with additions (Prostate_DL). Several names for one organ are an error, except for bone, whose parts add up where none is named after
    all of it.
    wanted : the caller's own choice, organ -> names, or the file's numbers of them. numbers : name -> that number.

    Raises InputError listing the names where the choice is not clear, or a wanted name is not there.
    """
    chosen = _chosen_by_caller(names, source, wanted or {}, numbers or {})
    taken = {name for own in chosen.values() for name in own}
    notes: list[str] = []
    by_organ: dict[str, dict[str, list[str]]] = {}
    for name in names:
        meaning, additions = _meaning(name)
        if meaning is not None and name not in taken:
            by_organ.setdefault(meaning, {}).setdefault(additions, []).append(name)
    both_halves = "prostate" not in chosen and by_organ.keys() >= {"prostate_left", "prostate_right"}
    for organ, sets in by_organ.items():
        if organ in chosen or (organ.startswith("prostate_") and "prostate" in chosen and not both_halves):
            continue
        chosen[organ] = _the_one_set(organ, sets, source)
        passed_over = [name for group in sets.values() for name in group if name not in chosen[organ]]
        left_out = f"; not used: {_listed(passed_over)}" if passed_over else ""
        if passed_over or [label_named(name) for name in chosen[organ]] != [organ]:
            notes.append(f"{organ} is {' + '.join(chosen[organ])}{left_out}")
    return chosen, notes


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
        chosen[organ] = _picked(list(own), names, numbers, source)
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


def _meaning(name: str) -> tuple[str | None, str]:
    """The organ a name stands for, and the words it adds; (None, "") when it is no organ of ours."""
    label = label_named(name)
    if label is not None:
        return label, ""
    parts = words_of(name)
    if words.DERIVED_WORDS.intersection(parts) or re.search(r"\d\s*[mc]m|\+\s*\d", name.lower()):
        return None, ""
    organs = [organ for organ, known in words.ORGAN_WORDS.items() if known.intersection(parts)]
    if len(organs) != 1:
        return None, ""
    organ = organs[0]
    if organ != "bone" and words.PARTS_OF_SOFT_ORGANS.intersection(parts):
        return None, ""
    neutral = words.ORGAN_WORDS[organ] | words.NEUTRAL_WORDS | words.LEFT | words.RIGHT
    neutral |= words.NEUTRAL_BESIDE_BONE if organ == "bone" else frozenset()
    additions = " ".join(word for word in parts if word not in neutral)
    if organ == "prostate":
        sides = [side for side, known in (("left", words.LEFT), ("right", words.RIGHT)) if known.intersection(parts)]
        organ = f"prostate_{sides[0]}" if len(sides) == 1 else organ
    return organ, additions


def _the_one_set(organ: str, sets: dict[str, list[str]], source: str) -> list[str]:
    plainest = [key for key in sets if not set(key.split()) - words.BESIDE_RECTUM]
    key = min(plainest or list(sets), key=len)
    clear = bool(plainest) or len(sets) == 1
    if not clear or (len(sets[key]) > 1 and organ != "bone"):
        choices = ", ".join(name for group in sets.values() for name in group)
        raise InputError(f"{source} has several structures for {organ}: {choices}; choose one with --roi {organ}=NAME")
    # A structure named after all bone holds its parts: femoral heads beside it, which may be balls, are drawn twice.
    return [name for name in sets[key] if organ == "bone" and label_named(name) == organ] or sets[key]


@lru_cache(maxsize=4096)
def _unglued(word: str) -> tuple[str, ...]:
    """The known words that a longer one is made of (rettoano, lfemur); the word itself where it is not."""
    if word in _GLUE or word in _SIDES_IN_GLUE or len(word) > 40:
        return (word,)
    plain_vowels = word.replace("ae", "a").replace("oe", "o").replace("ue", "u")
    if plain_vowels in _GLUE:
        return (plain_vowels,)
    found = _split(word, True) or _split(plain_vowels, True)
    # A side alone beside letters is chance; beside an organ it is a side.
    return found if found and any(_GLUE.get(part) for part in found) else (word,)


def _split(word: str, at_start: bool) -> tuple[str, ...]:
    if not word:
        return ()
    for end in range(len(word), _SHORTEST_GLUED - 1, -1):
        rest = _split(word[end:], False) if word[:end] in _GLUE else ()
        if word[:end] in _GLUE and (end == len(word) or rest):
            return (word[:end], *rest)
    # A side at the beginning (lfemur) or the end (femursx).
    if not at_start and word in _SIDES_IN_GLUE:
        return (word,)
    for end in (1, 2):
        if at_start and word[:end] in _SIDES_IN_GLUE and (rest := _split(word[end:], False)):
            return (word[:end], *rest)
    return ()
