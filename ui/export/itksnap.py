"""For ITK-SNAP: scans, label volumes and stiffness as NIfTI, the label description file, and workspaces that open them."""

from __future__ import annotations

from pathlib import Path

from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.labels_on_scan import bones_on_scan, labels_on_scan
from palpate.core.files.atomic import atomic_path
from palpate.imaging.contours.itksnap_labels import label_description
from palpate.imaging.contours.itksnap_workspace import LABEL_LAYER, MAIN, OVERLAY, Layer, workspace_text
from palpate.imaging.labels import BONE_PART_COLOURS, BONE_PARTS
from palpate.ui.export.stiffness import stiffness_volume, written_nifti

WRITES = "NIfTI: scans, label volumes, bones, stiffness in kPa; labels.txt, bones.txt; a workspace of each scan with all of it"
_STIFFNESS = "stiffness_kpa.nii.gz"


def export(case: CaseFolder, folder: Path, tissue: bool = False) -> list[Path]:
    """Writes what the case has, both states in the frame of the scan at rest. Raises InputError where it cannot.

    Labels, bones and stiffness lie on the voxels of their scan: ITK-SNAP opens a segmentation only on those.
    """
    written: list[Path] = []
    sizes: dict[str, tuple[int, ...]] = {}
    for state in STATES:
        if case.has_labels(state):
            written.append(written_nifti(folder / f"{state}_labels.nii.gz", labels_on_scan(case, state, tissue)))
        bones = bones_on_scan(case, state)
        if bones is not None:
            written.append(written_nifti(folder / f"{state}_bones.nii.gz", bones))
        if case.has(f"{state}_ct"):
            ct = case.ct(state)
            sizes[state] = ct.array.shape
            written.append(written_nifti(folder / f"{state}_ct.nii.gz", ct))
    if case.has("result.json"):
        written.append(written_nifti(folder / _STIFFNESS, stiffness_volume(case)))
    texts = {"labels.txt": label_description()}
    if any(path.name.endswith("_bones.nii.gz") for path in written):
        texts["bones.txt"] = label_description(BONE_PARTS, BONE_PART_COLOURS)
    texts |= {f"{s}.itksnap": workspace_text(_layers(s, folder, written), folder, size) for s, size in sizes.items()}
    for name, text in texts.items():
        with atomic_path(folder / name) as path:
            path.write_text(text, encoding="utf-8")
    return written + [folder / name for name in texts]


def _layers(state: str, folder: Path, written: list[Path]) -> list[Layer]:
    """The workspace of one scan: it, its labels, and over it the other scan (hidden at first) and the stiffness."""
    other = next(s for s in STATES if s != state)
    wanted = [
        Layer(folder / f"{state}_ct.nii.gz", MAIN, f"CT {state}"),
        Layer(folder / f"{state}_labels.nii.gz", LABEL_LAYER, f"labels {state}"),
        Layer(folder / f"{other}_ct.nii.gz", OVERLAY, f"CT {other}, aligned", opacity=0.0),
    ]
    if state == "rest":
        wanted.append(Layer(folder / _STIFFNESS, OVERLAY, "G, kPa (research use only)", "Jet", 0.4))
    return [layer for layer in wanted if layer.path in written]
