"""Two scans of a made-up pelvis as DICOM, the prostate pushed from behind in the second one: something to try the program on.

python docs/examples/phantom.py FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.volume import Volume
from palpate.simulate.phantom import phantom


def pushed(points: FloatArray, push_mm: float) -> FloatArray:
    """Where each point (n, 3) mm of the second scan was in the first."""
    away = (points - phantom.ORIGIN_MM - [0.0, 22.0, 0.0]) / [22.0, 18.0, 26.0]
    return points + push_mm * np.exp(-0.5 * (away**2).sum(axis=1))[:, None] * [0.0, 1.0, 0.0]


def main(
    folder: Path, spacing_mm: tuple[float, float, float] = (2.0, 2.0, 3.0), push_mm: float = 5.0
) -> tuple[Path, Path]:
    """Writes both scans; their folders."""
    size = np.array([350.0, 240.0, 150.0])
    shape = np.ceil(size / spacing_mm).astype(int)
    affine = np.diag([*spacing_mm, 1.0])
    affine[:3, 3] = phantom.ORIGIN_MM - 0.5 * size
    grid = Volume(np.zeros(shape, dtype=np.int16), affine)
    points = grid.to_lps(np.indices(grid.array.shape).reshape(3, -1).T.astype(float))
    for number, (state, places) in enumerate((("rest", points), ("deformed", pushed(points, push_mm)))):
        noise = np.random.default_rng(number).normal(0.0, 8.0, len(points))
        ct = grid.with_array(np.rint(phantom.hu(places) + noise).astype(np.int16).reshape(grid.array.shape))
        who = SeriesIdentity(
            "0000", "Made^Up", f"phantom {state}", state, state, number + 1, "study", "CT", "docs/examples/phantom.py"
        )
        write_ct_series(folder / state, ct, who, compress=False)
    return folder / "rest", folder / "deformed"


if __name__ == "__main__":
    print(*main(Path(sys.argv[1])), sep="\n")
