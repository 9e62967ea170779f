"""Results for other programs: one exporter a file, found by its name.

Each module has ``WRITES`` (what it makes, in a few words) and ``export(case, folder, tissue=False) -> list of the files
written``. tissue : keep the surrounding tissue among labels; forms without labels have nothing to keep.
"""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType


def names() -> tuple[str, ...]:
    """The exporters there are, by the names a person gives."""
    return tuple(sorted(m.name.replace("_", "-") for m in pkgutil.iter_modules(__path__) if m.name != "stiffness"))


def exporter(name: str) -> ModuleType:
    """The exporter of a name that ``names`` lists."""
    return importlib.import_module(f"{__name__}.{name.replace('-', '_')}")
