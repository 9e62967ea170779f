"""Options that state of every number its unit, what it is and where it comes from.

A field of such a class is declared as ``Annotated[float, sourced(unit, meaning, source)] = value``. The docs' tables, the JSON Schema and
what a result records are made from that one declaration.
"""

from __future__ import annotations

from dataclasses import fields
from typing import get_type_hints

import msgspec


def sourced(unit: str, meaning: str, source: str) -> msgspec.Meta:
    """What is known of a number. unit : "1" for a number without one. source : equation, measurement and its command, or "chosen: ..."."""
    known = {"unit": unit, "source": source}
    return msgspec.Meta(description=meaning, extra=known, extra_json_schema=known)


class Row(msgspec.Struct, frozen=True):
    """One number of an options class. value : a number or a tuple of them."""

    name: str
    value: float | tuple[float, ...]
    unit: str
    meaning: str
    source: str


def rows(options: object) -> list[Row]:
    """Every field of an options object (a dataclass), as it stands there. Raises TypeError when a field is not declared by `sourced`."""
    hints = get_type_hints(type(options), include_extras=True)
    out = []
    for field in fields(options):  # type: ignore[arg-type]
        known = [m for m in getattr(hints[field.name], "__metadata__", ()) if isinstance(m, msgspec.Meta) and m.extra]
        if len(known) != 1 or known[0].extra is None:
            raise TypeError(
                f"{type(options).__name__}.{field.name} does not say its unit and source; declare it by `sourced`"
            )
        extra = known[0].extra
        value = getattr(options, field.name)
        out.append(Row(field.name, value, str(extra["unit"]), str(known[0].description), str(extra["source"])))
    return out
