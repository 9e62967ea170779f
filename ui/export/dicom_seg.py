"""For PACS and DICOM viewers: the labels of both states as DICOM segmentations."""

from __future__ import annotations

from pathlib import Path

from palpate.case.case_folder import STATES, CaseFolder
from palpate.core.errors import InputError
from palpate.ui.dicom.label_segments import label_segmentation
from palpate.ui.dicom.making import save

WRITES = "DICOM SEG: the labels of each state, in the frame of its own CT"


def export(case: CaseFolder, folder: Path, tissue: bool = False) -> list[Path]:
    """Writes STATE_seg.dcm of each state that has labels and a CT. Raises InputError when none has, or it cannot write."""
    states = [state for state in STATES if case.has_labels(state) and case.has(f"{state}_ct")]
    if not states:
        raise InputError(
            f"{case.path} has no state with both labels and a CT: run `palpate segment` first, or, where it came without CT, "
            "import the scans as DICOM"
        )
    return [save(label_segmentation(case, state, tissue), folder / f"{state}_seg.dcm") for state in states]
