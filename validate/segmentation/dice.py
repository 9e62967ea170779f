"""How well found organs agree with drawn ones: Dice by organ and by what a person pointed at."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import TypedDict, cast

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.core.statistics import rms
from palpate.imaging.volume import Volume
from palpate.segmentation.error_estimate import MOST_MM
from palpate.segmentation.pelvis import segment_pelvis
from palpate.segmentation.prompts import ORGANS, Prompts
from palpate.segmentation.surface_error import SurfaceErrors, surface_errors
from palpate.segmentation.working_grid import mask_on, signed_distance

MODES = ("auto", "click", "extremes")
# Extreme points as a person sets them: off by so many mm along each axis (standard deviation).
JITTERED, JITTER_MM = "jittered", 1.5


class DiceFigures(TypedDict):
    """A `DiceRow` as JSON, figures rounded."""

    organ: str
    mode: str
    dice: float
    share_inside: float
    volume_cc: float
    reference_cc: float
    shift_mm: float
    confidence: float | None
    seconds: float
    said_mm: float | None
    true_mm: float | None


@dataclass(frozen=True)
class DiceRow:
    """One organ found in one way. share_inside : share of the drawn organ that was found (what counts for bone).

    shift_mm : from the drawn organ's centroid to the found one's. seconds : of the whole segmentation in this mode.
    said_mm, true_mm : error of its surface along the normal, rms, as estimated and against the drawing; None where it was not
    asked for. confidence : the Dice that the estimated errors leave, where they were asked for.
    """

    organ: str
    mode: str
    dice: float
    share_inside: float
    volume_cc: float
    reference_cc: float
    shift_mm: float
    confidence: float | None
    seconds: float = 0.0
    said_mm: float | None = None
    true_mm: float | None = None

    def to_dict(self) -> DiceFigures:
        """The JSON object of a row, figures rounded."""
        places = {"said_mm": 3, "true_mm": 3}
        rounded = {k: round(v, places.get(k, 4)) if isinstance(v, float) else v for k, v in asdict(self).items()}
        return cast(DiceFigures, rounded)


def dice(a: BoolArray, b: BoolArray) -> float:
    """Dice coefficient of two masks of one shape; 1 for two empty ones."""
    total = int(a.sum()) + int(b.sum())
    return 1.0 if total == 0 else 2.0 * int((a & b).sum()) / total


def dice_table(
    ct: Volume, reference: Mapping[str, Volume], modes: Iterable[str] = MODES, seed: int = 1, errors: bool = False
) -> list[DiceRow]:
    """Segments a CT (HU) in each mode and compares with drawn masks.

    reference : organ -> mask; prostate, bladder, rectum, and bone or parts of it such as bone_left_femur. Clicks and
    extreme points are taken from the reference: its centre, and its outermost voxels. seed : of the errors of the points
    in the mode "jittered". errors : whether the surfaces' errors are estimated too, which takes as long again.

    Raises InputError for an unknown mode or organ, or an empty reference.
    """
    for name, mask in reference.items():
        if name not in ORGANS and not name.startswith("bone"):
            raise InputError(f"{name!r} is no organ that is compared; known are {', '.join(ORGANS)} and bone")
        if not mask.array.any():
            raise InputError(f"the reference of {name} is empty; correct the structure's name")
    rows = []
    for mode in modes:
        start = time.perf_counter()
        prompts = prompts_of(mode, reference, seed)
        found = segment_pelvis(ct, prompts)
        seconds = time.perf_counter() - start
        said = surface_errors(found.scene, prompts, found.organs) if errors else {}
        for name, mask in reference.items():
            bone = name.startswith("bone")
            if (bone and mode != "auto") or (not bone and name not in found.organs):
                continue
            known = None if bone else found.organs[name].confidence
            row = _row(name, mode, found.mask("bone" if bone else name, mask), mask, known)
            row = replace(row, seconds=seconds)
            rows.append(_with_errors(row, said[name], found.scene.grid, mask) if name in said else row)
    return rows


def click_of(mask: Volume) -> FloatArray:
    """Where a person would click on an organ: the voxel of the mask nearest its centroid, (3,) mm."""
    points = mask.to_lps(np.argwhere(mask.array).astype(float))
    away = np.linalg.norm(points - points.mean(axis=0), axis=1)
    return np.asarray(points[away.argmin()])


def extremes_of(mask: Volume) -> FloatArray:
    """The six extreme points (6, 3) mm of an organ: the middle of its outermost voxels along x, y, z."""
    points = mask.to_lps(np.argwhere(mask.array).astype(float))
    found = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            along = sign * points[:, axis]
            # Half a voxel out: the organ ends between voxel centres.
            point = points[along > along.max() - 1e-3].mean(axis=0)
            point[axis] += sign * 0.5 * mask.spacing[axis]
            found.append(point)
    return np.array(found)


def prompts_of(mode: str, reference: Mapping[str, Volume], seed: int) -> Prompts:
    """What a person points at in a mode, from drawn masks. Raises InputError for an unknown mode."""
    organs = {name: mask for name, mask in reference.items() if name in ORGANS}
    if mode == "auto":
        return Prompts()
    if mode == "click":
        return Prompts({name: click_of(mask) for name, mask in organs.items()})
    if mode == "extremes":
        return Prompts({}, {name: extremes_of(mask) for name, mask in organs.items()})
    if mode == JITTERED:
        random = np.random.default_rng(seed)
        exact = {name: extremes_of(mask) for name, mask in organs.items()}
        return Prompts({}, {name: points + random.normal(0.0, JITTER_MM, (6, 3)) for name, points in exact.items()})
    raise InputError(f"the mode {mode!r} is unknown; known are {', '.join((*MODES, JITTERED))}")


def true_errors(points: FloatArray, grid: Volume, reference: Volume) -> FloatArray:
    """Signed distance (n,) mm of points (n, 3) mm from a drawn organ's outline, cut at MOST_MM. grid : even and upright."""
    distance = signed_distance(mask_on(reference, grid), grid)
    return np.clip(distance.at(points), -MOST_MM, MOST_MM)


def _with_errors(row: DiceRow, said: SurfaceErrors, grid: Volume, reference: Volume) -> DiceRow:
    true = rms(true_errors(said.points, grid, reference))
    return replace(row, said_mm=rms(said.sd_mm), true_mm=true, confidence=said.expected_dice)


def _row(organ: str, mode: str, found: BoolArray, reference: Volume, confidence: float | None) -> DiceRow:
    drawn = reference.array.astype(bool)
    voxel_cc = float(np.abs(np.linalg.det(reference.affine[:3, :3]))) / 1000.0
    shift = np.nan
    if found.any():
        centres = [reference.to_lps(np.argwhere(m).mean(axis=0)[None])[0] for m in (found, drawn)]
        shift = float(np.linalg.norm(centres[0] - centres[1]))
    inside = int((found & drawn).sum()) / int(drawn.sum())
    volumes = float(found.sum()) * voxel_cc, float(drawn.sum()) * voxel_cc
    return DiceRow(organ, mode, dice(found, drawn), inside, *volumes, shift, confidence)
