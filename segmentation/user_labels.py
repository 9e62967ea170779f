"""Labels that a person drew on a scan: a NIfTI label volume or an RT structure set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.core.errors import InputError
from palpate.segmentation.dicom_series import SeriesFacts
from palpate.segmentation.itksnap import label_values
from palpate.segmentation.labels import LABELS
from palpate.segmentation.nifti_labels import read_labels
from palpate.segmentation.rtstruct import read_rtstruct
from palpate.segmentation.volume import Volume


@dataclass(frozen=True, eq=False)
class UserLabels:
    """volume : labels in the scan's frame. source : "nifti" or "rtstruct". prostate_is_split : False where value 1 stands
    for the whole prostate, left and right yet to be told apart. structures : organ -> names in the structure set.
    """

    volume: Volume
    source: str
    prostate_is_split: bool
    structures: Mapping[str, Sequence[str]]
    notes: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """What user_labels.json says of one state."""
        present = [LABELS[int(value)] for value in np.unique(self.volume.array) if value]
        return {
            "source": self.source,
            "labels": present,
            "prostate_is_split": self.prostate_is_split,
            "structures": {organ: list(names) for organ, names in self.structures.items()},
        }


def read_user_labels(
    path: Path | str, ct: Volume, facts: SeriesFacts | None = None, roi: Mapping[str, Sequence[str]] | None = None
) -> UserLabels:
    """The labels drawn on a CT. Raises InputError naming the file when it cannot be read or lies elsewhere."""
    path = Path(path)
    if not path.name.lower().endswith((".nii", ".nii.gz")):
        structures = read_rtstruct(path, ct, facts, roi)
        return UserLabels(
            structures.labels(ct), "rtstruct", structures.prostate_is_split, structures.names, structures.notes
        )
    description = path.parent / "labels.txt"
    volume = read_labels(path, label_values(description) if description.is_file() else None)
    points = volume.to_lps(np.argwhere(volume.array > 0).astype(float))
    index = ct.to_index(points)
    inside = np.all((index >= -0.5) & (index <= np.array(ct.array.shape) - 0.5), axis=1).mean()
    if inside < 0.5:
        raise InputError(
            f"{path}: {100 * (1 - inside):.0f} % of the labels lie outside the CT; give the labels drawn on this scan"
        )
    return UserLabels(volume, "nifti", True, {}, ())
