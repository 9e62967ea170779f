"""Labels that a person drew on a scan, from whatever program."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from palpate.core.errors import InputError
from palpate.imaging.contours.detached_parts import detached_notes
from palpate.imaging.contours.label_reader import Roi, UserLabels
from palpate.imaging.contours.readers import reader_by_suffix, reader_of
from palpate.imaging.contours.readers.nifti import read_volume
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume


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
    """A NIfTI label volume by the names of the labels.txt beside it or within it, by the caller's choice, or by the numbers of LABELS.

    roi : organ -> names of that file, or the volume's own numbers. Raises InputError naming the file.
    """
    return _with_parts(read_volume(path, roi))


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
