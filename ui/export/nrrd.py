"""For 3D Slicer and other ITK programs: label volumes as segmentations, stiffness as a volume, both NRRD."""

from __future__ import annotations

from pathlib import Path

import SimpleITK as sitk

from palpate.segmentation.atomic import atomic_path
from palpate.segmentation.case import STATES, CaseFolder
from palpate.segmentation.seg_nrrd import write_seg_nrrd
from palpate.ui.export.stiffness import stiffness_volume

WRITES = "NRRD: label volumes as .seg.nrrd, stiffness in kPa"


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes what the case has, in the frame of the scan at rest. Raises InputError where it cannot."""
    written = []
    for state in STATES:
        if case.has_labels(state):
            written.append(folder / f"{state}_labels.seg.nrrd")
            with atomic_path(written[-1]) as path:
                write_seg_nrrd(path, case.labels(state))
    if case.has("result.json"):
        written.append(folder / "stiffness_kpa.nrrd")
        with atomic_path(written[-1]) as path:
            sitk.WriteImage(stiffness_volume(case).to_sitk(), str(path), useCompression=True)
    return written
