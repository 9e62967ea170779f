"""Labels that the program found, exported, and were given back, changed or not.

An exported label file lies on the voxels of its CT. Where a file's voxels are those that the program itself would export,
its organ stays found automatically, with the estimated error of its surface. Only a changed organ is a person's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, MutableMapping, MutableSequence
from dataclasses import dataclass

import numpy as np

from palpate.case.aligned_labels import lies_on
from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.contours import read_contours
from palpate.case.labels_on_scan import without_tissue
from palpate.case.step_records import OrganRecord
from palpate.core.arrays import BoolArray, FloatArray
from palpate.imaging.grid import cropped, differing, labels_on
from palpate.imaging.labels import BLADDER, BONE, ORGAN_LABELS, OUTSIDE, RECTUM, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.segmentation.surface_error import SurfaceErrors

_ORGANS = {"prostate": ORGAN_LABELS, "bladder": (BLADDER,), "rectum": (RECTUM,), "bone": (BONE,)}
# Labels of every file that an export writes; a file without one of them was drawn elsewhere.
_ALWAYS = (*ORGAN_LABELS, BONE)


@dataclass(frozen=True, eq=False)
class ReturnedLabels:
    """Comparison of one state's given labels with those that the program found.

    labels : on the grid of those found, rest frame, changed where a person changed them. changed : organs with a voxel more
    or less. kept : organs that are exactly as they were found.
    """

    labels: Volume
    changed: tuple[str, ...]
    kept: tuple[str, ...]


def returned_volumes(case: CaseFolder) -> dict[str, Volume]:
    """Given label volumes by state, rest frame, where every given one may be an export's: on the voxels of its CT, with both
    halves of the prostate and bone. Empty otherwise. Raises InputError naming an unreadable file.
    """
    given = {state: contours for state in STATES if (contours := read_contours(case, state)) is not None}
    for state, contours in given.items():
        holds_all = np.isin(_ALWAYS, contours.volume.array).all() and contours.prostate_labels is not None
        if not (holds_all and case.has(f"{state}_ct") and lies_on(contours.volume, case.ct(state))):
            return {}
    return {state: contours.volume for state, contours in given.items()}


def compared(found: Volume, given: Volume, ct: Volume) -> ReturnedLabels:
    """Comparison on the voxels of the CT, the grid of every export. found : labels as the program writes them, rest frame.

    A voxel of `found` takes the given label where the CT voxel that it lies in was changed, and keeps its own elsewhere.
    """
    scan = cropped(ct, *_box_of((found, given)))
    drawn = labels_on(given.with_array(_organs_only(given)), scan)
    exported = without_tissue(found, tissue=False)
    voxels = differing(exported, drawn)
    if not voxels.any():
        return ReturnedLabels(found, (), tuple(_names(np.unique(drawn.array))))
    index = np.argwhere(np.ones(found.array.shape, dtype=bool)).astype(np.float64)
    nearest = np.rint(scan.to_index(found.to_lps(index))).astype(int)
    inside = ((nearest >= 0) & (nearest < np.array(scan.array.shape))).all(axis=1)
    place = tuple(np.clip(nearest, 0, np.array(scan.array.shape) - 1).T)
    touched: BoolArray = (inside & voxels[place]).reshape(found.array.shape)
    new = drawn.array[place].reshape(found.array.shape)
    kept_body = np.where(exported.array == OUTSIDE, found.array, SURROUNDING_TISSUE)
    new = np.where(new == OUTSIDE, kept_body, new)
    labels = found.with_array(np.where(touched, new, found.array).astype(np.uint8))
    changed = _names({*np.unique(drawn.array[voxels]), *np.unique(found.array[labels.array != found.array])})
    return ReturnedLabels(labels, changed, tuple(n for n in _names(np.unique(drawn.array)) if n not in changed))


def take_over(
    state: str,
    returned: ReturnedLabels,
    organs: MutableMapping[str, OrganRecord],
    errors: MutableMapping[str, SurfaceErrors],
    notes: MutableSequence[str],
) -> None:
    """Record a comparison: a changed organ is a person's, without an estimated error; a note says what was changed."""
    voxel_cc = float(np.prod(returned.labels.spacing)) / 1000.0
    for organ in returned.changed:
        errors.pop(organ, None)
        if organ in organs:
            count = int(np.isin(returned.labels.array, _ORGANS[organ]).sum())
            organs[organ] = {"method": "user", "confidence": 1.0, "volume_cc": round(count * voxel_cc, 2)}
    what = f"changed by hand: {', '.join(returned.changed)}" if returned.changed else "nothing was changed"
    notes.append(f"{state}: the given labels were compared with those that the program finds; {what}")


def are_drawn(returned: Mapping[str, ReturnedLabels]) -> bool:
    """Whether the labels came from elsewhere: in no state is an organ exactly as the program finds it."""
    return not any(set(one.kept) - {"bone"} for one in returned.values())


def _names(values: Iterable[int]) -> tuple[str, ...]:
    present = {int(value) for value in values}
    return tuple(name for name, labels in _ORGANS.items() if present & set(labels))


def _organs_only(given: Volume) -> np.ndarray:
    return np.where(given.array == SURROUNDING_TISSUE, OUTSIDE, given.array).astype(np.uint8)


def _box_of(volumes: Iterable[Volume]) -> tuple[FloatArray, FloatArray]:
    """Corners (3,), LPS mm, of the box that holds all labelled voxels."""
    ends = []
    for volume in volumes:
        labelled = np.argwhere(volume.array)
        low, high = labelled.min(axis=0) - 1.0, labelled.max(axis=0) + 1.0
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        ends.append(volume.to_lps(corners))
    points = np.concatenate(ends)
    return points.min(axis=0), points.max(axis=0)
