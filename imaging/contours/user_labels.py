"""Labels that a person drew on a scan, from whatever program."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from palpate.core.errors import InputError
from palpate.imaging.contours.detached_parts import detached_notes
from palpate.imaging.contours.label_reader import Roi, UserLabels
from palpate.imaging.contours.readers import reader_by_suffix, reader_of, readers
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

# For labels on a grid of their own.
_NO_CT = Volume(np.zeros((1, 1, 1), dtype=np.int16), np.eye(4))


def read_user_labels(
    path: Path | str, ct: Volume, facts: SeriesFacts | None = None, roi: Roi = None, placed: bool = True
) -> UserLabels:
    """The labels drawn on a CT, in any form of `imaging/contours/readers`.

    roi : organ -> names or numbers of its structures in the file, where names do not tell. placed : check that the labels
    lie where the CT is; False for whoever moves them first and checks then (`lying_in`).

    Raises InputError naming the file when it cannot be read or lies elsewhere.
    """
    path = Path(path)
    labels = _with_parts(reader_of(path).read(path, ct, facts, roi))
    return lying_in(labels, ct, path) if placed else labels


def read_label_volume(path: Path, roi: Roi = None) -> UserLabels:
    """Labels that are voxels, without a CT: a label volume, or segments, in any form of `imaging/contours/readers` that holds voxels.

    roi : organ -> names of that file, or the volume's own numbers. Raises InputError naming the file.
    """
    reader = reader_by_suffix(path)
    if reader is None or not reader.holds_voxels:
        forms = ", ".join(reader.words for reader in readers().values() if reader.suffixes and reader.holds_voxels)
        raise InputError(f"{path} holds no voxels with labels; give {forms}")
    return _with_parts(reader.read(path, _NO_CT, None, roi))


def files_of(path: Path) -> list[Path]:
    """The files that a person's labels are read from: a workspace names its volume, a labels.txt beside a volume its values.

    Raises InputError when a workspace cannot be read.
    """
    reader = reader_by_suffix(path)
    return [path] if reader is None else reader.files(path)


def _with_parts(labels: UserLabels) -> UserLabels:
    return replace(labels, notes=(*labels.notes, *detached_notes(labels.volume)))


def lying_in(labels: UserLabels, ct: Volume, path: Path) -> UserLabels:
    """The labels. Raises InputError naming the file where most of them lie outside the CT."""
    volume = labels.volume
    points = volume.to_lps(np.argwhere(volume.array > 0).astype(float))
    index = ct.to_index(points)
    inside = np.all((index >= -0.5) & (index <= np.array(ct.array.shape) - 0.5), axis=1).mean()
    if inside < 0.5:
        raise InputError(
            f"{path}: {100 * (1 - inside):.0f} % of the labels lie outside the CT; give the labels drawn on this scan"
        )
    return labels
