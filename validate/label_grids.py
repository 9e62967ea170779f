"""Does the grid on which labels come matter? One pair's labels on five grids, each read, meshed and identified anew.

Labels go out as any program would write them, by the nearest voxel, in each scan's own coordinates, and come back as drawn by a
person. Whether the answers agree is asked of ln G in its own stated standard deviations; the truth is for the caller to know.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypedDict

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.identified import read_result
from palpate.case.labels_on_scan import own_labels
from palpate.core.arrays import FloatArray
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.grid import in_lps_order
from palpate.imaging.volume import Volume
from palpate.validate.sealed import run_program

# By name: the voxels' edges, mm (None: the scan's own), and by which share of a voxel the grid is shifted.
GRIDS: Mapping[str, tuple[tuple[float, float, float] | None, float]] = {
    "scan": (None, 0.0),
    "half a voxel aside": (None, 0.5),
    "1 mm": ((1.0, 1.0, 1.0), 0.0),
    "2 mm slices": ((1.2, 1.2, 2.0), 0.3),
    "3 mm slices": ((1.2, 1.2, 3.0), 0.0),
}
LOG, _TIMEOUT_S = "analysis.log", 3600.0
_STEPS = (("segment",), ("mesh",), ("identify", "--no-map", "--method", "gauss-newton"))
# Runs one command of the program in a folder.
Command = Callable[[Path, tuple[str, ...]], None]


class GridRow(TypedDict):
    """One region on one grid: G and its interval, kPa, the standard deviation of ln G, and how many of them it lies from the mean of
    all grids."""

    grid: str
    region: str
    G_kpa: float
    interval_kpa: tuple[float, float]
    sd_ln_G: float
    from_mean: float


class GridTable(TypedDict):
    """Rows, how many lie within one standard deviation of their mean, and grids without an answer."""

    rows: list[GridRow]
    within: int
    failed: list[str]


def label_grids(
    cases: Sequence[Path], folder: Path, command: Command | None = None, progress: Progress = silent
) -> GridTable:
    """Labels of cases with two CTs on every grid of `GRIDS`, in folder/CASE/GRID. What is there already is not made again.

    command : runs the program, in a process of its own where None is given. Raises InputError for a case without labels or CTs.
    """
    rows: list[GridRow] = []
    failed: list[str] = []
    run = command or _alone
    for number, path in enumerate(cases):
        case, answers = CaseFolder(path), dict[str, CaseFolder]()
        for k, grid in enumerate(GRIDS):
            progress((number + k / len(GRIDS)) / len(cases), f"{path.name}: {grid}")
            made = _answered(case, folder / path.name / grid.replace(" ", "_"), grid, run)
            answers |= {} if made is None else {grid: made}
            failed += [f"{path.name}: {grid}"] if made is None else []
        rows += grid_rows(answers)
    return {"rows": rows, "within": sum(abs(row["from_mean"]) <= 1.0 for row in rows), "failed": failed}


def table_text(found: GridTable) -> str:
    """The table for a person."""
    lines = [f"{'grid':20}{'region':16}{'G':>7}{'95 % interval':>18}{'sd ln G':>9}{'from mean':>11}"]
    for row in found["rows"]:
        ends = f"{row['interval_kpa'][0]:.1f} to {row['interval_kpa'][1]:.1f}"
        lines.append(
            f"{row['grid']:20}{row['region']:16}{row['G_kpa']:7.1f}{ends:>18}{row['sd_ln_G']:9.3f}{row['from_mean']:+11.2f}"
        )
    lines.append(
        f"{found['within']} of {len(found['rows'])} within one stated standard deviation of the mean over the grids"
    )
    return "\n".join([*lines, *(f"no answer: {name}" for name in found["failed"])])


def grid_rows(answers: Mapping[str, CaseFolder]) -> list[GridRow]:
    """Rows of one pair, from its identified cases by grid."""
    found = {grid: read_result(case).parameters for grid, case in answers.items()}
    rows: list[GridRow] = []
    for region in next(iter(found.values()), {}):
        ln_G = {grid: float(np.log(parameters[region].G_kpa)) for grid, parameters in found.items()}
        mean = float(np.mean(list(ln_G.values())))
        for grid, parameters in found.items():
            low, high = parameters[region].ci95_kpa or (np.nan, np.nan)
            sd = float(np.log(high / low)) / (2.0 * 1.96)
            rows.append(
                {
                    "grid": grid, "region": region, "G_kpa": parameters[region].G_kpa, "interval_kpa": (low, high), "sd_ln_G": sd,
                    "from_mean": (ln_G[grid] - mean) / sd,
                }
            )  # fmt: skip
    return rows


def on_grid(labels: Volume, voxel_mm: Sequence[float] | None, shift: float) -> Volume:
    """Labels by the nearest voxel on a grid with these edges, mm (None: their own), shifted by a share of a voxel along each axis."""
    step = labels.spacing if voxel_mm is None else np.array(voxel_mm)
    affine = labels.affine.copy()
    affine[:3, :3] = affine[:3, :3] / labels.spacing * step
    affine[:3, 3] += affine[:3, :3] @ np.full(3, shift)
    return _nearest(labels, np.ceil(np.array(labels.array.shape) * labels.spacing / step - 1e-9), affine)


def _nearest(labels: Volume, shape: FloatArray, affine: FloatArray) -> Volume:
    """Labels at the nearest of their voxels, on a grid of this shape (3,) and affine (4, 4)."""
    size = (int(shape[0]), int(shape[1]), int(shape[2]))
    grid = Volume(np.zeros(size, dtype=np.uint8), affine)
    found = labels.nearest(grid.to_lps(np.indices(size).reshape(3, -1).T.astype(float)))
    return grid.with_array(found.astype(np.uint8).reshape(size))


def _answered(case: CaseFolder, at: Path, grid: str, run: Command) -> CaseFolder | None:
    """The case of a grid, identified; None where the program gave no answer."""
    if not (at / "case" / "result.json").exists():
        at.mkdir(parents=True, exist_ok=True)
        for state in ("rest", "deformed"):
            scan = in_lps_order(case.series(state)[0])
            write_labels(at / f"{state}.nii.gz", on_grid(_on(scan, own_labels(case, state)), *GRIDS[grid]))
        scans = [str(case.file(f"{state}_ct").resolve()) for state in ("rest", "deformed")]
        labels = ("--rest-labels", "rest.nii.gz", "--deformed-labels", "deformed.nii.gz")
        for words in (("import", *scans, "-o", "case", *labels), *((step, "case", *more) for step, *more in _STEPS)):
            run(at, words)
    return CaseFolder(at / "case") if (at / "case" / "result.json").exists() else None


def _on(scan: Volume, labels: Volume) -> Volume:
    """Labels by the nearest voxel on the scan's own voxels, cut to where labels are."""
    corners: FloatArray = labels.to_lps(
        np.array(np.meshgrid(*([0, n - 1] for n in labels.array.shape))).reshape(3, -1).T.astype(float)
    )
    index = scan.to_index(corners)
    low = np.maximum(np.floor(index.min(axis=0)).astype(int), 0)
    high = np.minimum(np.ceil(index.max(axis=0)).astype(int) + 1, scan.array.shape)
    affine = scan.affine.copy()
    affine[:3, 3] = scan.to_lps(low[None].astype(float))[0]
    return _nearest(labels, (high - low).astype(float), affine)


def _alone(at: Path, words: tuple[str, ...]) -> None:
    run_program([*words, "--quiet", "--workers", "1"], at, LOG, _TIMEOUT_S)
