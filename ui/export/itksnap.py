"""For ITK-SNAP: scans, label volumes and stiffness as NIfTI, with the label description file."""

from __future__ import annotations

from pathlib import Path

from palpate.segmentation.atomic import atomic_path
from palpate.segmentation.case import STATES, CaseFolder
from palpate.segmentation.itksnap import label_description
from palpate.segmentation.nifti_labels import write_nifti
from palpate.segmentation.volume import Volume
from palpate.ui.export.stiffness import stiffness_volume

WRITES = "NIfTI: scans, label volumes, stiffness in kPa; labels.txt"


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes what the case has, both states in the frame of the scan at rest. Raises InputError where it cannot."""
    volumes: dict[str, Volume] = {}
    for state in STATES:
        if case.has(f"{state}_ct"):
            volumes[f"{state}_ct.nii.gz"] = case.ct(state)
        if case.has_labels(state):
            volumes[f"{state}_labels.nii.gz"] = case.labels(state)
    if case.has("result.json"):
        volumes["stiffness_kpa.nii.gz"] = stiffness_volume(case)
    for name, volume in volumes.items():
        with atomic_path(folder / name) as path:
            write_nifti(path, volume)
    with atomic_path(folder / "labels.txt") as path:
        path.write_text(label_description(), encoding="utf-8")
    return [folder / name for name in (*volumes, "labels.txt")]
