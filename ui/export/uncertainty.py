"""For other programs: how well the stiffness is known, and the smooth map within the organ, as volumes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.case.case_folder import CaseFolder
from palpate.case.identified import read_result
from palpate.case.labels_on_scan import labels_on_scan
from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.identify.map.stiffness_map import called_at, nearest_patch, painted
from palpate.imaging.labels import ORGAN_LABELS
from palpate.imaging.volume import Volume
from palpate.ui.export.stiffness import interval_volumes, written_nifti

WRITES = "NIfTI: each half's 95 % limits in kPa, and the smooth map with its factor and where the scans determine it"
_MAP = "identify/stiffness_map.npz"
# Voxels painted at a time: each asks for its distance to every patch.
_CHUNK = 50_000


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes on the grid of the scan at rest (of its labels without CT), 0 outside the organ:

    stiffness_low_kpa, stiffness_high_kpa : ends of each half's 95 % interval. map_kpa : the smooth map. map_factor : within
    which two of three true values lie (exp of the standard deviation of ln G). map_told : 1 where the scans say more of a
    deviation from the half's value than the prior does. map_called : 1 where a place is told to be stiffer than its half, -1 where
    softer. The maps are left out where the case has none. Raises InputError when it has no result.
    """
    labels, result = labels_on_scan(case, "rest"), read_result(case)
    volumes = {f"stiffness_{end}_kpa": volume for end, volume in (interval_volumes(case) or {}).items()}
    if result.stiffness_map and case.has(_MAP):
        volumes |= _map(labels, case.read_npz(_MAP))
    if not volumes:
        raise InputError(
            f"{case.file('result.json')} gives no interval and there is no map; run `palpate identify` again"
        )
    return [written_nifti(folder / f"{name}.nii.gz", volume) for name, volume in volumes.items()]


def _map(labels: Volume, arrays: Mapping[str, NDArray[np.generic]]) -> dict[str, Volume]:
    voxels = np.argwhere(np.isin(labels.array, ORGAN_LABELS))
    points, halves = labels.to_lps(voxels.astype(np.float64)), labels.array[tuple(voxels.T)].astype(np.int64)
    sd = np.asarray(arrays["sd"], dtype=np.float64)

    def volume(of: Callable[[FloatArray, IntArray], NDArray[np.generic]], kind: type) -> Volume:
        value: NDArray[np.generic] = np.zeros(labels.array.shape, dtype=kind)
        parts = [of(points[k : k + _CHUNK], halves[k : k + _CHUNK]) for k in range(0, len(points), _CHUNK)]
        value[tuple(voxels.T)] = np.concatenate(parts) if parts else 0
        return labels.with_array(value)

    return {
        "map_kpa": volume(lambda at, half: painted(arrays, at, half)[0], np.float32),
        "map_factor": volume(lambda at, half: np.exp(sd[nearest_patch(arrays, at, half)]), np.float32),
        "map_told": volume(lambda at, half: painted(arrays, at, half)[1], np.uint8),
        "map_called": volume(lambda at, half: called_at(arrays, at, half), np.int8),
    }
