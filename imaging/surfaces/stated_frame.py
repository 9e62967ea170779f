"""What a surface file says of its own coordinates in its header or comments: the unit, and which way the axes run."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError

# Bytes of a binary STL's header; comments of text files stand at their beginning.
_STL_HEADER, _FIRST_BYTES = 80, 8192
_COMMENT = {".stl": (b"solid",), ".obj": (b"#",), ".ply": (b"comment", b"obj_info")}
# 3D Slicer writes SPACE=RAS or SPACE=LPS.
_SPACE = re.compile(r"\bspace\s*=\s*([a-z-]+)", re.IGNORECASE)
_TURNS = {"LPS": (1.0, 1.0, 1.0), "RAS": (-1.0, -1.0, 1.0)}
_RATIO = re.compile(r"\b1\s+units?\s*=\s*([\d.]+(?:e[+-]?\d+)?)\s*([a-z]+)", re.IGNORECASE)
_UNIT = re.compile(r"\bunits?\s*[:=]\s*([a-z]+)", re.IGNORECASE)
_MM = {
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 10.0),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1000.0),
    **dict.fromkeys(("in", "inch", "inches"), 25.4),
}


@dataclass(frozen=True)
class StatedFrame:
    """turn : signs by which x, y and z are multiplied to be LPS. scale : mm of one unit. notes : where either is not plain."""

    turn: tuple[float, float, float] = _TURNS["LPS"]
    scale: float = 1.0
    notes: tuple[str, ...] = ()

    def in_lps_mm(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) in LPS, mm. A mirrored axis would turn the faces; two of them do not."""
        return points if self == StatedFrame() else points * (np.array(self.turn) * self.scale)


def stated_frame(path: Path) -> StatedFrame:
    """The frame that an STL, OBJ or PLY file states; LPS and mm where it states none.

    Raises InputError naming the file, with its words, where it states a space or unit that is not known here.
    """
    text = _comments(path)
    notes: list[str] = []
    turn, scale = _TURNS["LPS"], 1.0
    if space := _SPACE.search(text):
        if space[1].upper() not in _TURNS:
            raise InputError(f"{path} states {space[0]!r}, which is not known here; save it in LPS or RAS")
        turn = _TURNS[space[1].upper()]
        notes += [] if turn == _TURNS["LPS"] else [f"the file states {space[0]}: its points were turned to LPS"]
    if unit := _RATIO.search(text) or _UNIT.search(text):
        scale = float(unit[1]) * _unit(unit[2], unit[0], path) if unit.re is _RATIO else _unit(unit[1], unit[0], path)
        notes += [] if scale == 1.0 else [f"the file states {unit[0]!r}: its lengths were multiplied by {scale:g}"]
    return StatedFrame(turn, scale, tuple(notes))


def _unit(word: str, statement: str, path: Path) -> float:
    if word.lower() not in _MM:
        raise InputError(f"{path} states {statement!r}, a unit that is not known here; save it in mm")
    return _MM[word.lower()]


def _comments(path: Path) -> str:
    with path.open("rb") as stream:
        head = stream.read(_FIRST_BYTES)
    kind = path.suffix.lower()
    # A binary STL's header may begin with any word; a text one has its name there.
    lines = [head[:_STL_HEADER]] if kind == ".stl" else []
    lines += [line for line in head.splitlines() if line.strip().lower().startswith(_COMMENT[kind])]
    return "\n".join(line.decode("latin-1") for line in lines)
