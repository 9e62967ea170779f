"""A coarse pair of scans of the analytic pelvis: small enough that the real window opens and segments it in seconds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.volume import Volume
from palpate.simulate.phantom import phantom

SPACING = np.array([2.5, 2.5, 4.0])
EXTENT = np.array([350.0, 240.0, 150.0])
# How far the organ's back is pushed, to the front; and how the patient lies in the second scan.
PUSH_MM = 5.0
SHIFT_MM = np.array([3.0, -2.0, 4.0])


def write_pair(folder: Path) -> tuple[Path, Path]:
    """Writes rest and deformed under a folder as DICOM."""
    for number, (name, deformed) in enumerate((("rest", False), ("deformed", True)), start=1):
        grid = _grid()
        index = np.indices(grid.array.shape).reshape(3, -1).T.astype(float)
        points = grid.to_lps(index)
        values = phantom.hu(_where_it_was(points) if deformed else points)
        noise = np.random.default_rng(number).normal(0.0, 8.0, len(values))
        ct = grid.with_array(np.rint(values + noise).astype(np.int16).reshape(grid.array.shape))
        who = SeriesIdentity(
            "4711-XYZ", "Doe^Jane", "window", f"window {name}", name, number, "study", "CT", "drawn by a test"
        )
        write_ct_series(folder / name, ct, who, compress=False)
    return folder / "rest", folder / "deformed"


def _where_it_was(points: NDArray[np.float64]) -> NDArray[np.float64]:
    at = points - SHIFT_MM
    away = (at - phantom.ORIGIN_MM - np.array([0.0, 22.0, 0.0])) / np.array([22.0, 18.0, 26.0])
    push = PUSH_MM * np.exp(-0.5 * (away**2).sum(axis=1))
    return at + push[:, None] * np.array([0.0, 1.0, 0.0])


def _grid() -> Volume:
    shape = np.ceil(EXTENT / SPACING).astype(int)
    affine = np.diag([*SPACING, 1.0])
    affine[:3, 3] = phantom.ORIGIN_MM - 0.5 * (shape - 1) * SPACING + np.array([2.0, 10.0, 8.0])
    return Volume(np.zeros(shape, dtype=np.int16), affine)
