"""Palpate: tissue stiffness from two CT scans, with its uncertainty. Research use only.

From Python: `analyze` goes the whole way from two scans to a case, `load` opens a case folder, `identify` and `diagnose` take
arrays or pyvista meshes, `example_sphere` makes a body of known stiffness. The rooms are `palpate.core`, `palpate.imaging`,
`palpate.segmentation`, `palpate.meshing`, `palpate.simulate`, `palpate.case`, `palpate.validate` and `palpate.ui`. Importing this
package loads none of them.
"""

from __future__ import annotations

import importlib

__version__ = "0.1.0"
__all__ = ["analyze", "diagnose", "example_sphere", "identify", "load"]

# Their types are in __init__.pyi: importing a room here, even for its types alone, would tie all rooms to it.
_HOMES = {
    "analyze": "from_scans", "diagnose": "from_arrays", "identify": "from_arrays", "load": "from_case", "example_sphere": "sphere",
}  # fmt: skip


def __getattr__(name: str) -> object:
    """The public functions, loaded when they are first asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module 'palpate' has no attribute {name!r}")
    return getattr(importlib.import_module(f"palpate.ui.python.{_HOMES[name]}"), name)
