"""For 3D Slicer and other ITK programs: label volumes and stiffness as NRRD."""

from __future__ import annotations

from pathlib import Path

import SimpleITK as sitk

from palpate.segmentation.atomic import atomic_path
from palpate.segmentation.case import STATES, CaseFolder
from palpate.ui.export.stiffness import stiffness_volume

WRITES = "NRRD: label volumes, stiffness in kPa"


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes what the case has, in the frame of the scan at rest. Raises InputError where it cannot."""
    volumes = {f"{state}_labels.nrrd": case.labels(state) for state in STATES if case.has_labels(state)}
    if case.has("result.json"):
        volumes["stiffness_kpa.nrrd"] = stiffness_volume(case)
    for name, volume in volumes.items():
        with atomic_path(folder / name) as path:
            sitk.WriteImage(volume.to_sitk(), str(path), useCompression=True)
    return [folder / name for name in volumes]
