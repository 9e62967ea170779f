"""Errors of the surfaces that the segmentation found, by place: surface_errors.npz, which `identify` and `diagnose` use."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.measured_noise import measured_noise
from palpate.case.stated_files import ERRORS_FILE
from palpate.case.step_records import SegmentationRecord
from palpate.core.arrays import FloatArray, NumberArray
from palpate.core.errors import InputError
from palpate.core.problem import SurfacePair
from palpate.core.surfaces.surface import Surface
from palpate.imaging.labels import BLADDER, ORGAN_LABELS, RECTUM
from palpate.imaging.propagation.options import PropagationOptions
from palpate.imaging.volume import Volume
from palpate.segmentation.error_estimate import ErrorNumbers

if TYPE_CHECKING:
    from palpate.segmentation.surface_error import SurfaceErrors

SEGMENTATION = "segmentation.json"
# Method of an organ that the segmentation found and a person then corrected.
CORRECTED = "corrected"
# Least and most that a file may say, mm.
_LEAST_MM, _MOST_MM = 1e-3, 50.0
# A surface is called by what it is in the mesh.
_SURFACES = {"prostate": "organ", "bladder": "bladder", "rectum": "rectum"}
_LABELS = {"organ": ORGAN_LABELS, "bladder": (BLADDER,), "rectum": (RECTUM,)}


def write_surface_errors(
    case: CaseFolder,
    errors: Mapping[str, Mapping[str, SurfaceErrors]],
    one_drawing: Collection[str] = (),
    labels: Mapping[str, Volume] | None = None,
    drawn_in: str = STATES[0],
) -> None:
    """Write surface_errors.npz. errors : by state and organ; organs that a person contoured are absent.

    one_drawing : organs whose contours are those of one state, `drawn_in`, carried over to the other; errors of the first are
    given where nobody drew them there. labels : of both states, as they
    are written; what somebody corrects in them later is drawn. A surface that was carried over from one that was found has its whole
    error too, for when the first one is corrected.
    """
    numbers, arrays = ErrorNumbers(), dict[str, NumberArray]()
    for state, organs in errors.items():
        for organ, found in organs.items():
            name = _SURFACES[organ]
            arrays[f"{state}/{name}/points"] = found.points
            arrays[f"{state}/{name}/sd_mm"] = found.sd_mm
            if labels is not None:
                arrays[f"{state}/{name}/voxels"] = _digest({state: labels[state]}, name)
    second = STATES[1 - STATES.index(drawn_in)]
    for organ in one_drawing:
        name = _SURFACES[organ]
        arrays[f"{name}/one_drawing"] = np.array(True)
        arrays[f"{name}/carried_to_rest"] = np.array(drawn_in != STATES[0])
        source = errors.get(drawn_in, {}).get(organ)
        if source is None:
            arrays[f"{drawn_in}/{name}/drawn"] = np.array(True)
        elif organ in errors.get(second, {}):
            carried = errors[second][organ]
            first = source.sd_mm[cKDTree(source.points).query(carried.points)[1]]
            arrays[f"{second}/{name}/whole_sd_mm"] = np.hypot(first, carried.sd_mm)
        if labels is not None:
            arrays[f"{name}/voxels"] = _digest(labels, name)
    arrays["common_share"] = np.array(numbers.common_share)
    every = {organ for organs in errors.values() for organ in organs}
    length = (
        PropagationOptions().strain_length_mm if one_drawing and every <= set(one_drawing) else numbers.correlation_mm
    )
    arrays["correlation_mm"] = np.array(length)
    case.write_npz(ERRORS_FILE, **arrays)


class StatedErrors:
    """Content of surface_errors.npz; empty for a case without it, or whose contour noise somebody stated or measured.

    Raises InputError when the file is damaged or holds values that cannot be.
    """

    def __init__(self, case: CaseFolder) -> None:
        stated = case.facts.boundary_noise_sd_mm is not None or measured_noise(case) is not None
        self._case = case
        self._written = case.read_npz(ERRORS_FILE) if case.has(ERRORS_FILE) else {}
        self._arrays = {} if stated else self._written
        for name, values in self._arrays.items():
            if not np.isfinite(values).all():
                raise _refused(case, name)
            if name.endswith("sd_mm") and not ((values >= _LEAST_MM) & (values <= _MOST_MM)).all():
                raise _refused(case, name)
        try:
            self.correlation_mm = float(self._arrays.get("correlation_mm", ErrorNumbers().correlation_mm))
            self.common_share = float(self._arrays.get("common_share", 0.0))
        except TypeError as error:
            raise _refused(case, "common_share") from error
        if not (1.0 <= self.correlation_mm <= 100.0 and 0.0 <= self.common_share < 1.0):
            raise _refused(case, "correlation_mm")

    def __bool__(self) -> bool:
        return any(name.endswith("/sd_mm") for name in self._arrays)

    def one_drawing(self, name: str) -> bool:
        """Whether a surface was drawn or found in one scan and carried over to the other, and nobody corrected it since. Raises
        InputError when a label volume cannot be read."""
        return f"{name}/one_drawing" in self._written and self._unchanged(STATES, f"{name}/voxels", name)

    def found_automatically(self, state: str, name: str) -> bool:
        """Whether the segmentation found a surface in a state, and nobody corrected it there since. Raises InputError when a
        label volume cannot be read."""
        found = f"{state}/{name}/sd_mm" in self._written and f"{state}/{name}/drawn" not in self._written
        return found and self._unchanged((state,), f"{state}/{name}/voxels", name)

    def shows_motion(self, name: str) -> bool:
        """Whether the surfaces of both states, as somebody drew them, say by themselves how an organ moved: not where one was
        carried over from the other, nor where nobody drew the deformed one."""
        return not (self.one_drawing(name) or self.found_automatically("deformed", name))

    def corrected(self, state: str, organ: str) -> bool:
        """Whether the segmentation found an organ ("prostate", "bladder", "rectum") in a state, and somebody corrected it there since.
        Raises InputError when a label volume cannot be read."""
        name = _SURFACES.get(organ, "")
        return not self._unchanged((state,), f"{state}/{name}/voxels", name)

    def _unchanged(self, states: Sequence[str], digest: str, name: str) -> bool:
        """Whether a surface's voxels are those that were written; True for a file that does not say what they were."""
        written = self._written.get(digest)
        if written is None or not all(self._case.has_labels(state) for state in states):
            return True
        return np.array_equal(written, _digest({state: self._case.labels(state) for state in states}, name))

    def on(self, surface: Surface, state: str, name: str) -> Surface:
        """The surface with its errors: of the nearest point that the segmentation gave one. name : "organ", "bladder" or
        "rectum"."""
        whole = f"{state}/{name}/whole_sd_mm" in self._arrays
        return _with_errors(surface, self._arrays, f"{state}/{name}", "whole_sd_mm" if whole else "sd_mm")

    def pair(self, pair: SurfacePair, name: str) -> SurfacePair:
        """Both surfaces with their errors. What carried one over is known by the file, whoever states another error of contours."""
        to = self._carried_to(name)
        rest, deformed = (
            _with_errors(surface, self._written, f"{state}/{name}") if state == to else self.on(surface, state, name)
            for state, surface in zip(STATES, (pair.rest, pair.deformed), strict=True)
        )
        # What both scans have in common is known of errors of one kind only.
        both = rest.sd_mm is not None and deformed.sd_mm is not None and not to
        return SurfacePair(rest, deformed, self.common_share if both else 0.0, to)

    def _carried_to(self, name: str) -> str:
        """State to which the surface of the other one was carried over; empty where it was not."""
        if not self.one_drawing(name):
            return ""
        to_rest = self._written.get(f"{name}/carried_to_rest", f"{STATES[1]}/{name}/drawn" in self._written)
        return STATES[0] if bool(to_rest) else STATES[1]

    def planned(self, pair: SurfacePair, name: str) -> SurfacePair:
        """Both surfaces of a planned pair, which will be found as the one at rest was, with its errors; one that is
        carried over errs again as the last one."""
        if self._carried_to(name):
            return self.pair(pair, name)
        rest = self.on(pair.rest, "rest", name)
        if rest.sd_mm is None:
            return pair
        return SurfacePair(rest, replace(pair.deformed, sd_mm=rest.sd_mm), self.common_share)

    def rms_mm(self) -> dict[str, dict[str, float]]:
        """Error of each surface, rms over its points, mm: by state and name."""
        out: dict[str, dict[str, float]] = {}
        for state in STATES:
            for name in _SURFACES.values():
                sd: FloatArray | None = self._arrays.get(f"{state}/{name}/sd_mm")
                if sd is not None and len(sd):
                    out.setdefault(state, {})[name] = float(np.sqrt((sd**2).mean()))
        return out


def segmentation_now(case: CaseFolder) -> SegmentationRecord:
    """segmentation.json, empty where absent, with the method `CORRECTED` for organs that somebody corrected since.

    Raises InputError naming the file when it holds no JSON object.
    """
    found: SegmentationRecord = case.read_json(SEGMENTATION) if case.has(SEGMENTATION) else {}
    if not isinstance(found, dict):
        raise InputError(f"{case.file(SEGMENTATION)} holds no JSON object; run `palpate segment` again")
    errors = StatedErrors(case)
    for state, segmented in found.get("states", {}).items():
        organs = segmented.get("organs", {})
        organs.update({organ: {"method": CORRECTED} for organ in organs if errors.corrected(state, organ)})
    return found


def _with_errors(surface: Surface, arrays: Mapping[str, NumberArray], key: str, sizes: str = "sd_mm") -> Surface:
    points, sd = (arrays.get(f"{key}/{part}") for part in ("points", sizes))
    if points is None or sd is None or len(points) == 0 or len(surface.points) == 0:
        return surface
    return replace(surface, sd_mm=np.asarray(sd[cKDTree(points).query(surface.points)[1]], dtype=np.float64))


def _digest(labels: Mapping[str, Volume], name: str) -> NumberArray:
    """SHA-256 (32,) of the voxels of a surface's organ in all given states."""
    found = hashlib.sha256()
    for state in labels:
        found.update(np.packbits(np.isin(labels[state].array, _LABELS[name])).tobytes())
    return np.frombuffer(found.digest(), dtype=np.uint8)


def _refused(case: CaseFolder, name: str) -> InputError:
    return InputError(f"{case.file(ERRORS_FILE)}: {name} holds values that cannot be; run `palpate segment` again")
