"""A case folder as the body that a simulation deforms."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.imaging.labels import ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.imaging.scans.scan import read_scan
from palpate.simulate.source import VolumeSource


def case_source(path: Path) -> VolumeSource:
    """A case folder as a source. Raises InputError, naming the file, when it has no labels or they lack organ or
    tissue.
    """
    case = CaseFolder(path)
    file = case.file("rest.nii.gz")
    if not case.has_labels("rest"):
        raise InputError(f"{file} is not there; contour the case or run `palpate segment` first")
    labels = case.labels("rest")
    present = set(np.unique(labels.array).tolist())
    for wanted, what in ((ORGAN_LABELS, "organ (1, 2)"), ((SURROUNDING_TISSUE,), "surrounding tissue (3)")):
        if not present & set(wanted):
            raise InputError(f"{file} holds no {what}; run `palpate segment` or draw it")
    ct = read_scan(case.file("rest_ct"))[0] if case.has("rest_ct") else None
    return VolumeSource(case.facts.name, labels, ct)
