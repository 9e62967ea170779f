"""Damaging a good file: what hypothesis draws, and the check that a parser reads or refuses what came of it."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hypothesis import strategies as st
from targets import Target

from palpate.core.errors import InputError

_TOKENS = (
    b"", b"NaN", b"-1", b"0", b"1e999", b"99999999999999999999", b"null", b"true", b'""', b"[]", b"{}", b"\x00", b"\xff\xfe",
    b"\xef\xbb\xbf", b"\n", b"=", b",", b"<", b"&x;", b"../../etc", b"\xc3\x28", "\u0661".encode(), b"0x10", b"1_0",
)  # fmt: skip
_NUMBERS = (0, 1, 2, 8, 16, 127, 128, 255, 256, 32767, 32768, 65535, 2**31 - 1, 2**32 - 1)


_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 0.5, 1e308, -1e308, float("nan"), float("inf"), 10**30, "", "x", "../x", "1", "rest", [], [0],
    [1, 2, 3], [None], [[]], {}, {"": None}, {"name": 1}, "\u0000", "a\nb",
)  # fmt: skip


@st.composite
def damaged(draw: st.DrawFn, good: bytes, is_text: bool) -> bytes:
    """A good file changed in one to six places: what JSON says, or bytes."""
    # Almost every changed byte of a JSON file ends in a syntax error: what lies behind is reached by changed values.
    if is_text and good[:1] == b"{" and draw(st.booleans()):
        return _damaged_json(draw, good)
    return _damaged_bytes(draw, good, is_text)


def _damaged_json(draw: st.DrawFn, good: bytes) -> bytes:
    """Values replaced, left out or put in place of others."""
    data = json.loads(good)
    for _ in range(draw(st.integers(1, 3))):
        places = list(_places(data))
        if not places:
            break
        holder, key = draw(st.sampled_from(places))
        if draw(st.integers(0, 4)) == 0:
            del holder[key]
        else:
            holder[key] = copy.deepcopy(draw(st.sampled_from(_VALUES)))
    return json.dumps(data).encode()


def _places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Every (object, key) and (list, index) in parsed JSON."""
    keys = list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ()
    for key in keys:
        yield data, key
        yield from _places(data[key])


def _damaged_bytes(draw: st.DrawFn, good: bytes, is_text: bool) -> bytes:
    """Bytes changed, put in, taken out, swapped or cut off, where headers are rather than anywhere."""
    data = bytearray(good)
    for _ in range(draw(st.integers(1, 6))):
        near = draw(st.booleans())
        at = draw(st.integers(0, max(min(len(data), 400 if near else len(data)) - 1, 0)))
        kind = draw(st.integers(0, 6))
        if kind == 0:
            data[at : at + 1] = bytes([draw(st.integers(0, 255))])
        elif kind == 1 and data:
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == 2:
            data[at : at + draw(st.integers(0, 12))] = draw(st.sampled_from(_TOKENS))
        elif kind == 3:
            size = draw(st.sampled_from((1, 2, 4)))
            data[at : at + size] = (draw(st.sampled_from(_NUMBERS)) % 256**size).to_bytes(size, "little")
        elif kind == 4:
            length = draw(st.integers(1, 80))
            data[at:at] = data[at : at + length]
        elif kind == 5:
            del data[at : at + draw(st.integers(1, 80))]
        elif not is_text or draw(st.booleans()):
            data = data[: max(at, 1)]
    return bytes(data)


def check(target: Target, data: bytes) -> bool:
    """Whether the parser refused: in one line that names the file. Any other exception goes through."""
    target.path.write_bytes(data)
    try:
        target.read()
    except InputError as error:
        text = str(error)
        # Points are typed, not read from a file; a specification's errors name the property.
        assert "\n" not in text, text
        assert (
            Path(target.path).name in text or target.name in ("prompts", "spec") or str(target.path.parent) in text
        ), text
        return True
    return False
