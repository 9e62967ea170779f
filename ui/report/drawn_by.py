"""Which program draws the report: a report of other words or pictures is out of date, whatever the version's number says."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from palpate import __version__

_UI = Path(__file__).resolve().parents[1]
_DRAWING = ("words/*.py", "pictures/**/*.py", "report/**/*.py", "report/*.html")


@cache
def drawn_by() -> str:
    """The version, and SHA-256 in hex of every file that has a say in how a report looks."""
    digest = hashlib.sha256()
    for path in sorted(path for pattern in _DRAWING for path in _UI.glob(pattern)):
        digest.update(f"{path.relative_to(_UI).as_posix()}\0".encode() + path.read_bytes() + b"\0")
    return f"{__version__} {digest.hexdigest()}"
