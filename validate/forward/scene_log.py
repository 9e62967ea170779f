"""Outcomes of random scenes in a file of one JSON object a line, so that a study that was stopped goes on where it was."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path

from palpate import core
from palpate.core.errors import InputError
from palpate.core.worker.messages import encode

Row = dict[str, str | float | int | bool]
_CORE = Path(core.__file__).parent
_SCENES = tuple(Path(__file__).with_name(name) for name in ("random_scenes.py", "robustness.py"))


def code_fingerprint() -> str:
    """SHA-256 of the solver's and the scenes' source: outcomes of other code are not this code's."""
    digest = hashlib.sha256()
    for path in sorted([*(_CORE / "fem").rglob("*.py"), *(_CORE / "laws").glob("*.py"), *_SCENES]):
        digest.update(f"{path.parent.name}/{path.name}".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def read_rows(path: Path, fingerprint: str) -> dict[int, Row]:
    """Rows by seed of the same code; a last line that a kill cut short is left out. Raises InputError for an unreadable file."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({type(error).__name__}); name another file") from error
    rows: dict[int, Row] = {}
    for line in lines:
        try:
            row = json.loads(line)
        except ValueError:
            continue
        if isinstance(row, dict) and row.pop("code", None) == fingerprint and isinstance(row.get("seed"), int):
            rows[row["seed"]] = row
    return rows


def append_rows(path: Path, rows: Iterable[Row], fingerprint: str) -> None:
    """Add rows at the end, each begun on a line of its own. Raises InputError when the file cannot be written."""
    text = "".join(encode({**row, "code": fingerprint}) + "\n" for row in rows)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a+b") as stream:
            size = stream.seek(0, 2)
            if size:
                stream.seek(size - 1)
                if stream.read(1) != b"\n":  # a kill cut the last line short
                    text = "\n" + text
            stream.write(text.encode())
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); choose a writable place") from error
