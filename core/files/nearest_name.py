"""What to do about a name that is not known: the one that was probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Collection


def nearest(name: str, known: Collection[str]) -> str:
    """The known name that is written most like another, as a question; all of them where none is."""
    close = difflib.get_close_matches(name.casefold(), known, n=1, cutoff=0.7)
    return f"is {close[0]!r} meant?" if close else f"known are {', '.join(known)}"
