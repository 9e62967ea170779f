"""Which contoured structure is which organ, by its name in English, Italian, German, French or Spanish."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence

from palpate.core.errors import InputError

# Words that name an organ, without accents, lower case.
_ORGAN_WORDS: dict[str, frozenset[str]] = {
    "prostate": frozenset({"prostate", "prostata", "prostatica", "prostat"}),
    "bladder": frozenset({"bladder", "vescica", "blase", "harnblase", "vessie", "vejiga", "vesica"}),
    "rectum": frozenset({"rectum", "retto", "rektum", "recto", "anorectum", "enddarm", "mastdarm"}),
    "bone": frozenset(
        {
            "femur",
            "femurs",
            "femora",
            "femoral",
            "femore",
            "femori",
            "femorale",
            "femorali",
            "femurkopf",
            "femurkopfe",
            "femoris",
            "fem",
        }
        | {"huftkopf", "hueftkopf", "femorales", "bone", "bones", "osso", "ossa", "knochen", "hueso", "huesos"}
        | {"sacrum", "sacro", "pubis", "pube", "ischium", "ilium", "coxal", "acetabulum", "pelvis", "bacino", "becken"}
        | {"hip", "hips", "coccyx", "coccige", "steissbein", "coxae"}
    ),
}
ORGANS = (*_ORGAN_WORDS, "prostate_left", "prostate_right")
# Words that may stand beside them without changing what is meant.
_NEUTRAL_WORDS = frozenset(
    {"head", "heads", "testa", "teste", "kopf", "tete", "tetes", "cabeza", "cabezas", "neck", "gland", "urinary"}
    | {"urinaria", "urinaire", "the", "of", "di", "de", "del", "della", "organ", "oar", "contour", "manual"}
)
_LEFT = frozenset(
    {
        "left",
        "l",
        "lt",
        "li",
        "links",
        "sinistra",
        "sinistro",
        "sin",
        "sx",
        "gauche",
        "g",
        "izquierda",
        "izquierdo",
        "izq",
    }
)
_RIGHT = frozenset(
    {"right", "r", "rt", "re", "rechts", "destra", "destro", "dx", "droite", "droit", "d", "derecha", "derecho", "der"}
)
# Volumes made from an organ with a margin, or without a part: never the organ itself.
_DERIVED_WORDS = frozenset(
    {"ptv", "ctv", "gtv", "itv", "prv", "ring", "dose", "opt", "avoid", "avoidance", "minus", "plus", "wall", "parete"}
    | {
        "wand",
        "paroi",
        "pared",
        "bed",
        "loggia",
        "loge",
        "vesicles",
        "seminal",
        "seminali",
        "sv",
        "vs",
        "vvss",
        "boost",
        "margin",
        "not",
        "sub",
        "hot",
    }
)


def words_of(name: str) -> list[str]:
    """A structure's name as words: lower case, no accents, split at signs, digits and CamelCase."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain)
    return re.findall(r"[a-z]+|\d+", parted.lower())


def choose_rois(
    names: Sequence[str], source: str, wanted: Mapping[str, Sequence[str]] | None = None
) -> tuple[dict[str, list[str]], list[str]]:
    """The structures of each organ, organ -> names, and notes on those passed over.

    Organs are prostate, prostate_left, prostate_right, bladder, rectum and bone; an organ without a structure is
    left out. A plain name (Prostata) goes before one with additions (Prostate_DL). Several names for one organ are an
    error, except for bone, whose parts add up.
    wanted : the caller's own choice, organ -> names.

    Raises InputError listing the names where the choice is not clear, or a wanted name is not there.
    """
    chosen: dict[str, list[str]] = {}
    notes: list[str] = []
    for organ, own in (wanted or {}).items():
        if organ not in ORGANS:
            raise InputError(f"--roi {organ} is no organ; known are {', '.join(ORGANS)}")
        missing = [name for name in own if name not in names]
        if missing:
            raise InputError(f"{source} has no structure {missing[0]!r}; it has {', '.join(names)}; correct --roi")
        chosen[organ] = list(own)
    by_organ: dict[str, dict[str, list[str]]] = {}
    for name in names:
        meaning, additions = _meaning(name)
        if meaning is not None:
            by_organ.setdefault(meaning, {}).setdefault(additions, []).append(name)
    for organ, sets in by_organ.items():
        if organ in chosen or (organ.startswith("prostate_") and "prostate" in chosen):
            continue
        chosen[organ] = _the_one_set(organ, sets, source)
        passed_over = [name for group in sets.values() for name in group if name not in chosen[organ]]
        left_out = f"; not used: {', '.join(passed_over)}" if passed_over else ""
        notes.append(f"{organ} is {' + '.join(chosen[organ])}{left_out}")
    return chosen, notes


def _meaning(name: str) -> tuple[str | None, str]:
    """The organ a name stands for, and the words it adds; (None, "") when it is no organ of ours."""
    words = words_of(name)
    if _DERIVED_WORDS.intersection(words) or re.search(r"\d\s*mm|[+-]\s*\d", name.lower()):
        return None, ""
    organs = [organ for organ, known in _ORGAN_WORDS.items() if known.intersection(words)]
    if len(organs) != 1:
        return None, ""
    organ = organs[0]
    additions = [w for w in words if w not in _ORGAN_WORDS[organ] | _NEUTRAL_WORDS | _LEFT | _RIGHT]
    if organ == "prostate":
        sides = [side for side, known in (("left", _LEFT), ("right", _RIGHT)) if known.intersection(words)]
        organ = f"prostate_{sides[0]}" if len(sides) == 1 else organ
    return organ, " ".join(additions)


def _the_one_set(organ: str, sets: dict[str, list[str]], source: str) -> list[str]:
    names = sets[""] if "" in sets else next(iter(sets.values()))
    clear = "" in sets or len(sets) == 1
    if not clear or (len(names) > 1 and organ != "bone"):
        choices = ", ".join(name for group in sets.values() for name in group)
        raise InputError(f"{source} has several structures for {organ}: {choices}; choose one with --roi {organ}=NAME")
    return names


def organ_of(name: str) -> str | None:
    """The organ that a structure's name stands for; None when it is none of ours."""
    return _meaning(name)[0]
