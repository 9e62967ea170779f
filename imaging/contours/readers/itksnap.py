"""Workspaces of ITK-SNAP: a label volume, and the names of its values."""

from __future__ import annotations

from pathlib import Path

from palpate.core.errors import InputError
from palpate.imaging.contours.itksnap_workspace import LABEL_LAYER, Workspace, read_workspace
from palpate.imaging.contours.label_reader import LabelReader, Roi, StructureEntry, UserLabels
from palpate.imaging.contours.nifti_labels import NIFTI
from palpate.imaging.contours.numbered_volume import numbered, numbers_as_labels, numbers_as_structures
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

_SOURCE = "itksnap"


def _opened(path: Path) -> tuple[Path, Workspace]:
    """The label volume that a workspace names, and the workspace."""
    workspace = read_workspace(path)
    return workspace.only(LABEL_LAYER, str(path)).path, workspace


def _read(path: Path, ct: Volume, facts: SeriesFacts | None, roi: Roi) -> UserLabels:
    file, workspace = _opened(path)
    if not file.name.lower().endswith(NIFTI):
        raise InputError(f"{path} names {file.name} as its segmentation; save that as NIfTI (.nii.gz) in ITK-SNAP")
    return numbers_as_labels(numbered(file), workspace.names, str(path), _SOURCE, roi)


def _structures(path: Path) -> list[StructureEntry]:
    file, workspace = _opened(path)
    return numbers_as_structures(numbered(file), workspace.names)


def _files(path: Path) -> list[Path]:
    return [path, _opened(path)[0]] if path.is_file() else [path]


READER = LabelReader(
    _SOURCE, "ITK-SNAP workspace", _read, _structures, (".itksnap",), holds_voxels=True, files=_files
)  # fmt: skip
