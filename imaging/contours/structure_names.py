"""What a structure's name means: an organ's word with known additions, or an organ's word with others, which may change it."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from functools import lru_cache

from palpate.imaging.contours import organ_words as words
from palpate.imaging.labels import LABEL_VALUES

# Two structures of one name are told apart by the file's own numbers, which are no part of the name.
_NUMBERED = re.compile(r" #\d+$")
# TG-263: a structure that is not contoured over its whole length.
PARTIAL = "~"
# Signs that part words without a meaning of their own.
_SEPARATORS = frozenset(" \t_-.,:;()[]{}/\\|'\"^#&")
_GLUE = {
    **{word: organ for organ, known in words.ORGAN_WORDS.items() for word in known},
    **dict.fromkeys(words.NEUTRAL_WORDS | words.NEUTRAL_BESIDE_BONE | words.BESIDE_RECTUM, ""),
    **dict.fromkeys(words.DERIVED_WORDS, ""),
}
_SIDES_IN_GLUE = words.LEFT | words.RIGHT
_SHORTEST_GLUED = 3
# Numbers with more digits than this are no place in a list, nor that of a vertebra.
_DIGITS = 2


@dataclass(frozen=True)
class Meaning:
    """organ : whose word is in the name, None without any. additions : further words, the key of a set of structures.

    unknown : those of them that may change what is meant.
    """

    organ: str | None = None
    additions: str = ""
    unknown: tuple[str, ...] = ()


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
    """The organ that a structure's name stands for; None when it is none of ours, or may be something made from it."""
    meaning = meaning_of_name(name)
    return None if meaning.unknown else meaning.organ


def meaning_of_name(name: str) -> Meaning:
    """The organ a name stands for, and what it adds."""
    label = label_named(name)
    if label is not None:
        return Meaning(label)
    parts = words_of(name)
    if words.DERIVED_WORDS.intersection(parts) or re.search(r"\d\s*[mc]m|\+\s*\d", name.lower()):
        return Meaning()
    organs = [organ for organ, known in words.ORGAN_WORDS.items() if known.intersection(parts)]
    if len(organs) != 1:
        return Meaning()
    organ = organs[0]
    if organ != "bone" and words.PARTS_OF_SOFT_ORGANS.intersection(parts):
        return Meaning()
    neutral = words.ORGAN_WORDS[organ] | words.NEUTRAL_WORDS | words.LEFT | words.RIGHT
    neutral |= words.NEUTRAL_BESIDE_BONE if organ == "bone" else frozenset()
    additions = [word for word in parts if word not in neutral]
    signs = _signs(name)
    unknown = [word for word in additions if not _is_known(word, organ, parts)]
    if organ == "prostate":
        sides = [side for side, known in (("left", words.LEFT), ("right", words.RIGHT)) if known.intersection(parts)]
        organ = f"prostate_{sides[0]}" if len(sides) == 1 else organ
    return Meaning(organ, " ".join([*additions, *signs]), (*unknown, *(sign for sign in signs if sign != PARTIAL)))


def _is_known(word: str, organ: str, parts: list[str]) -> bool:
    """Whether a word beside an organ's leaves what is meant: who drew it, its place in a list, a vertebra's number, the anus."""
    if word.isdigit():
        first = min(at for at, part in enumerate(parts) if part in words.ORGAN_WORDS[organ])
        return len(word) <= _DIGITS and (organ == "bone" or parts.index(word) < first)
    return word in words.DRAWN_BY or (organ == "rectum" and word in words.BESIDE_RECTUM)


def _signs(name: str) -> list[str]:
    """Characters of a name that are neither letters, digits and accents of Latin script nor separators."""
    composed = unicodedata.normalize("NFKD", _NUMBERED.sub("", name).replace("ß", "ss"))
    return [
        char for char in composed
        if char not in _SEPARATORS and not (char.isascii() and char.isalnum()) and not unicodedata.combining(char)
    ]  # fmt: skip


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
