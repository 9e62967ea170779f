"""Whether this machine can open a window, found out in a child: where a library is missing, Qt ends the process that asks."""

from __future__ import annotations

import os
import subprocess
import sys

from palpate.core.errors import InputError
from palpate.ui import system_libraries

_TRY = "from PySide6.QtWidgets import QApplication; QApplication([])"
_TIMEOUT_S = 60.0


def check(headless: bool) -> None:
    """Raises InputError with the line that helps when a window, or one without a screen, cannot be made here."""
    absent = () if headless else system_libraries.missing()
    if absent:
        lacking = "libraries of the system that it needs are absent"
        raise InputError(f"no window can be opened ({lacking}); on Debian: {system_libraries.remedy(absent)}")
    if not headless and sys.platform.startswith("linux") and not _has_screen():
        raise InputError(
            "there is no display (DISPLAY and WAYLAND_DISPLAY are not set); run it on a desktop, or with --headless"
        )
    platform = {"QT_QPA_PLATFORM": "offscreen"} if headless else {}
    command = [sys.executable, "-P", "-c", _TRY]
    try:
        done = subprocess.run(
            command, capture_output=True, timeout=_TIMEOUT_S, check=False, env={**os.environ, **platform}
        )
    except subprocess.TimeoutExpired as late:
        raise InputError(f"the display did not answer within {_TIMEOUT_S:.0f} s; check DISPLAY") from late
    if done.returncode != 0:
        lines = [line for line in done.stderr.decode(errors="replace").splitlines() if line.strip()]
        why = lines[0].strip() if lines else f"status {done.returncode}"
        if "connect to display" in why:
            raise InputError(f"no window can be opened ({why}); start it from a desktop, or correct DISPLAY")
        packages = system_libraries.remedy(tuple(sorted(set(system_libraries.WINDOW.values()))))
        raise InputError(f"no window can be opened ({why}); on Debian try: {packages}")


def _has_screen() -> bool:
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"))
