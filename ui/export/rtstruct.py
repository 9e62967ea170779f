"""For treatment planning systems: the organs as DICOM RT structure sets."""

from __future__ import annotations

from pathlib import Path

from palpate.case.case_folder import STATES, CaseFolder
from palpate.core.errors import InputError
from palpate.ui.dicom.making import save
from palpate.ui.dicom.structure_set import structure_set

WRITES = "DICOM RTSTRUCT: contours of the organs of each state, on the slices of its own CT"


def export(case: CaseFolder, folder: Path, tissue: bool = False) -> list[Path]:
    """Writes STATE_rtstruct.dcm of each state with labels and a CT. Raises InputError when none has, or it cannot write."""
    states = [state for state in STATES if case.has_labels(state) and case.has(f"{state}_ct")]
    if not states:
        raise InputError(
            f"{case.path} has no state with both labels and a CT; an RTSTRUCT is drawn on a CT: import the scans as DICOM"
        )
    return [save(structure_set(case, state, tissue), folder / f"{state}_rtstruct.dcm") for state in states]
