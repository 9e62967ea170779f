"""Results for other programs: one exporter a file, found by its name.

Each module has ``WRITES`` (what it makes, in a few words) and ``export(case, folder) -> list of the files written``; one that
writes labels takes ``tissue=False`` too: whether the surrounding tissue is kept among them.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from palpate.core.errors import InputError
from palpate.core.files.places import check_utf8

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder


def names() -> tuple[str, ...]:
    """The exporters there are, by the names a person gives."""
    return tuple(sorted(m.name.replace("_", "-") for m in pkgutil.iter_modules(__path__) if m.name != "stiffness"))


def exporter(name: str) -> ModuleType:
    """The exporter of a name that ``names`` lists."""
    return importlib.import_module(f"{__name__}.{name.replace('-', '_')}")


def export(name: str, case: CaseFolder, folder: Path, tissue: bool = False) -> list[Path]:
    """Writes a case in the form of that name; returns the files. tissue : keep the surrounding tissue among the labels.

    Raises InputError where the exporter does, for `tissue` in a form without labels, and for a folder within a scan of the case.
    """
    write = exporter(name).export
    check_utf8(folder, "choose another folder")
    files: list[Path]
    from palpate.case.case_folder import check_beside_scans  # here, because it takes seconds to load

    check_beside_scans(case, folder)
    if tissue and "tissue" not in inspect.signature(write).parameters:
        raise InputError(f"{name} writes no labels that the tissue could be kept among; leave --tissue out")
    files = write(case, folder, tissue=True) if tissue else write(case, folder)
    return files
