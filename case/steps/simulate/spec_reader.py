"""Checked reading of a JSON specification: every refusal names the property, its value and what is allowed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from palpate.core.errors import InputError


class Reader:
    """Reads keys of one JSON object; `path` names the object in messages."""

    def __init__(self, data: Any, path: str) -> None:
        if not isinstance(data, Mapping):
            raise InputError(f"simulation spec: {path.rstrip('.') or 'it'} is {data!r}; it must be a JSON object")
        self.data = data
        self.path = path

    def refuse(self, key: str, allowed: str) -> InputError:
        """The error that says what is wrong with a key."""
        found = f"is {self.data[key]!r}" if key in self.data else "is missing"
        return InputError(f"simulation spec: {self.path}{key} {found}; it must be {allowed}")

    def only(self, keys: str) -> None:
        """Refuses keys that are not among the words of ``keys``."""
        for key in self.data:
            if key not in keys.split():
                raise InputError(f"simulation spec: {self.path}{key} is unknown; allowed are {', '.join(keys.split())}")

    def part(self, key: str) -> Reader:
        """The object under a key; an empty one where it is absent."""
        return Reader(self.data.get(key, {}), f"{self.path}{key}.")

    def number(self, key: str, default: float | None, low: float, high: float, whole: bool = False) -> float:
        """A number in a range; without a default the key must be there."""
        value = self.data.get(key, default)
        if not _is_number(value) or not low <= value <= high or (whole and value != int(value)):
            raise self.refuse(key, f"a {'whole ' if whole else ''}number from {low:g} to {high:g}")
        return float(value)

    def numbers(self, key: str, default: tuple[float, ...], low: float, high: float) -> tuple[float, ...]:
        """As many numbers as the default has."""
        value = self.data.get(key, default)
        ok = isinstance(value, list | tuple) and len(value) == len(default)
        if not ok or not all(_is_number(v) and low <= v <= high for v in value):
            raise self.refuse(key, f"{len(default)} numbers from {low:g} to {high:g}")
        return tuple(float(v) for v in value)

    def choice(self, key: str, allowed: tuple[str, ...]) -> str:
        """One of some words; the first where the key is absent."""
        value = self.data.get(key, allowed[0])
        if value not in allowed:
            raise self.refuse(key, " or ".join(repr(a) for a in allowed))
        return str(value)

    def text(self, key: str, default: str | None) -> str | None:
        """A text of one line."""
        value = self.data.get(key, default)
        if value is not None and (not isinstance(value, str) or not value.strip() or "\n" in value):
            raise self.refuse(key, "a text of one line")
        return value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
