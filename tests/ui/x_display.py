"""A real X display without a screen, for tests of real windows."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

needs_xvfb = pytest.mark.skipif(
    shutil.which("Xvfb") is None, reason="Xvfb is not on this machine: apt-get install xvfb"
)


@contextmanager
def x_display(folder: Path, size: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Xvfb at work, and DISPLAY naming it. size : WIDTHxHEIGHT. folder : for its log."""
    read, write = os.pipe()
    with (folder / "xvfb.log").open("wb") as log:
        command = ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{size}x24", "-nolisten", "tcp"]
        server = subprocess.Popen(command, pass_fds=[write], stderr=log)
    os.close(write)
    with os.fdopen(read) as told:
        monkeypatch.setenv("DISPLAY", f":{told.readline().strip()}")
    for name in ("QT_QPA_PLATFORM", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    try:
        yield
    finally:
        server.terminate()
        server.wait()
