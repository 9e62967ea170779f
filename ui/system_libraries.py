"""Which shared libraries of the system are absent, and the Debian packages that bring them.

The wheels of Qt and VTK bring all but these. Run as ``python -m palpate.ui.system_libraries`` it prints one line with the
packages to install, and nothing where none is absent; it imports nothing but Python's own modules, because it is also asked
where the others do not load.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Mapping

# Library -> Debian package: what libqxcb, libQt6XcbQpa, libQt6Gui, libQt6Widgets and libQt6DBus of PySide6 6.11 name as NEEDED
# (objdump -p) and do not bring along, and what these ask for at run time.
WINDOW: Mapping[str, str] = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libX11-xcb.so.1": "libx11-xcb1",
    "libxcb.so.1": "libxcb1",
    "libxcb-cursor.so.0": "libxcb-cursor0",
    "libxcb-icccm.so.4": "libxcb-icccm4",
    "libxcb-image.so.0": "libxcb-image0",
    "libxcb-keysyms.so.1": "libxcb-keysyms1",
    "libxcb-randr.so.0": "libxcb-randr0",
    "libxcb-render.so.0": "libxcb-render0",
    "libxcb-render-util.so.0": "libxcb-render-util0",
    "libxcb-shape.so.0": "libxcb-shape0",
    "libxcb-shm.so.0": "libxcb-shm0",
    "libxcb-sync.so.1": "libxcb-sync1",
    "libxcb-util.so.1": "libxcb-util1",
    "libxcb-xfixes.so.0": "libxcb-xfixes0",
    "libxcb-xkb.so.1": "libxcb-xkb1",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libxkbcommon-x11.so.0": "libxkbcommon-x11-0",
    "libfontconfig.so.1": "libfontconfig1",
    "libfreetype.so.6": "libfreetype6",
    "libdbus-1.so.3": "libdbus-1-3",
    "libglib-2.0.so.0": "libglib2.0-0",
}


def _loads(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def missing(loads: Callable[[str], bool] = _loads) -> tuple[str, ...]:
    """Debian packages that the window needs and that are not there, in the order of their names; none elsewhere than on Linux."""
    if not sys.platform.startswith("linux"):
        return ()
    return tuple(sorted({package for library, package in WINDOW.items() if not loads(library)}))


def remedy(packages: tuple[str, ...]) -> str:
    """The one line that installs packages."""
    return f"apt-get install {' '.join(packages)}"


if __name__ == "__main__":
    sys.stdout.write(" ".join(missing()))
