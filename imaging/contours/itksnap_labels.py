"""The label description file of ITK-SNAP (labels.txt)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from palpate.core.errors import InputError
from palpate.imaging.contours.numbered_labels import meaning_of_names
from palpate.imaging.contours.structure_names import label_named
from palpate.imaging.labels import LABEL_COLOURS, LABELS

_HEADER = """\
################################################
# ITK-SnAP Label Description File
# File format:
# IDX   -R-  -G-  -B-  -A--  VIS MSH  LABEL
# Fields:
#    IDX:   Zero-based index
#    -R-:   Red color component (0..255)
#    -G-:   Green color component (0..255)
#    -B-:   Blue color component (0..255)
#    -A-:   Label transparency (0.00 .. 1.00)
#    VIS:   Label visibility (0 or 1)
#    IDX:   Label mesh visibility (0 or 1)
#  LABEL:   Label description
################################################
"""
_LINE = re.compile(r'^\s*(\d+)\s+\d+\s+\d+\s+\d+\s+[\d.]+\s+[01]\s+[01]\s+"([^"]*)"\s*$')


def read_label_names(path: Path) -> dict[int, str]:
    """The names of a label description file, value -> name.

    Raises InputError naming the file and the line when a line has another form, or a value comes twice.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path} is not a readable text file; save the label descriptions again with ITK-SNAP"
        ) from error
    names: dict[int, str] = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        match = _LINE.match(line)
        if match is None:
            raise InputError(f"{path} line {number} is not a label description; save the file again with ITK-SNAP")
        if int(match[1]) in names:
            raise InputError(f"{path} line {number} describes the value {match[1]} a second time; keep one of them")
        names[int(match[1])] = match[2]
    return names


def label_values(path: Path) -> dict[int, int]:
    """What each number of a label volume means by its label description file; see ``meaning_of``."""
    return meaning_of(read_label_names(path), str(path))


def meaning_of(names: Mapping[int, str], source: str) -> dict[int, int]:
    """What each number of a label volume means by the names of its values: file value -> value of LABELS.

    Names decide, whatever their numbers; names of no organ are left out, so that a voxel holding one is refused. Where all names
    are those that ITK-SNAP gives by itself, the numbers are those of LABELS.
    Raises InputError naming ``source`` when two numbers have one name, or no name is an organ.
    """
    exact = [label_named(name) for name in names.values()]
    twice = [label for label in exact if label is not None and exact.count(label) > 1]
    if twice:
        raise InputError(f"{source} names two labels {twice[0]!r}; keep one of them")
    return meaning_of_names(names, source).values


def label_description(
    names: Mapping[int, str] = LABELS, colours: Mapping[int, tuple[int, int, int, float]] = LABEL_COLOURS
) -> str:
    """The text of the label description file of a case, or of another set of labels."""
    lines = []
    for value, name in {0: LABELS[0], **names}.items():
        red, green, blue, opacity = colours[value]
        shown = int(value != 0)
        lines.append(f'{value:5d} {red:5d} {green:4d} {blue:4d} {opacity:11g} {shown:3d} {shown:2d}    "{name}"\n')
    return _HEADER + "".join(lines)
