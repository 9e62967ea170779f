"""The cases that were open last, in the user's own settings."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from pathlib import Path

from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path

_KEPT = 10


def settings_folder() -> Path:
    """Where the user's settings are: PALPATE_SETTINGS, else the system's place for them."""
    chosen = os.environ.get("PALPATE_SETTINGS")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("APPDATA", Path.home())) / "palpate"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "palpate"
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "palpate"


def recent_file() -> Path:
    """The file with the list."""
    return settings_folder() / "recent.json"


def recent_cases() -> list[Path]:
    """Case folders that are still there, the last one first."""
    try:
        listed = json.loads(recent_file().read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    paths = [Path(entry) for entry in listed if isinstance(entry, str)] if isinstance(listed, list) else []
    return [path for path in paths if (path / "case.json").is_file()]


def remember(case: Path) -> None:
    """Puts a case first. A settings folder that cannot be written is no reason to stop."""
    case = case.absolute()
    listed = [str(case), *(str(path) for path in recent_cases() if path != case)][:_KEPT]
    with contextlib.suppress(InputError), atomic_path(recent_file()) as temporary:
        temporary.write_text(json.dumps(listed, indent=1), encoding="utf-8")
