"""For 3D Slicer and other ITK programs: scans and stiffness as volumes, labels as segmentations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import SimpleITK as sitk

from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.labels_on_scan import bones_on_scan, labels_on_scan
from palpate.core.files.atomic import atomic_path
from palpate.imaging.contours.seg_nrrd import write_seg_nrrd
from palpate.imaging.labels import BONE_PART_COLOURS, BONE_PARTS
from palpate.imaging.volume import Volume
from palpate.ui.export.stiffness import stiffness_volume
from palpate.ui.pictures.colours import STIFFNESS_LABEL, STIFFNESS_SCALE, StiffnessScale

WRITES = "NRRD: scans, labels and bones as .seg.nrrd, stiffness in kPa with its colour table"
# Colours of the table: so many that a step is not seen at the soft end of the logarithmic scale.
COUNT = 2048


def export(case: CaseFolder, folder: Path, tissue: bool = False) -> list[Path]:
    """Writes what the case has, in the frame of the scan at rest, labels on the voxels of their scan.

    Raises InputError where it cannot.
    """
    written = []
    for state in STATES:
        if case.has(f"{state}_ct"):
            written.append(_write(folder / f"{state}_ct.nrrd", case.ct(state)))
        if case.has_labels(state):
            written.append(folder / f"{state}_labels.seg.nrrd")
            with atomic_path(written[-1]) as path:
                write_seg_nrrd(path, labels_on_scan(case, state, tissue))
        if (bones := bones_on_scan(case, state)) is not None:
            written.append(folder / f"{state}_bones.seg.nrrd")
            with atomic_path(written[-1]) as path:
                write_seg_nrrd(path, bones, BONE_PARTS, BONE_PART_COLOURS)
    if case.has("result.json"):
        written.append(_write(folder / "stiffness_kpa.nrrd", stiffness_volume(case)))
        written.append(folder / "stiffness_kpa.ctbl")
        with atomic_path(written[-1]) as path:
            path.write_text(colour_table(STIFFNESS_SCALE), encoding="utf-8")
    return written


def _write(path: Path, volume: Volume) -> Path:
    with atomic_path(path) as temporary:
        sitk.WriteImage(volume.to_sitk(), str(temporary), useCompression=True)
    return path


def colour_table(scale: StiffnessScale) -> str:
    """The text of a colour file (.ctbl): a line a colour, evenly over the range that its head names, each called by its kPa."""
    values = np.linspace(scale.low, scale.high, COUNT)
    head = [f"# {STIFFNESS_LABEL}", f"# low_kpa {scale.low!r}", f"# high_kpa {scale.high!r}"]
    lines = []
    for index, value in enumerate(values):
        r, g, b = (round(255 * channel) for channel in scale.rgb(float(value)))
        lines.append(f"{index} {value:.4g}_kPa {r} {g} {b} 255")
    return "\n".join([*head, *lines, ""])
