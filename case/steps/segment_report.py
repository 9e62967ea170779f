"""Content of segmentation.json: method, volume and confidence of each label, and notes for the user."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from palpate.case.case_folder import STATES
from palpate.case.contours import Contours
from palpate.case.step_records import OrganRecord, SegmentedRecord
from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.statistics import rms
from palpate.imaging.labels import LABELS
from palpate.imaging.volume import Volume
from palpate.segmentation.pelvis import DOUBTFUL, Segmentation
from palpate.segmentation.prostate.halves import Plane
from palpate.segmentation.search_region import Found
from palpate.segmentation.surface_error import SurfaceErrors
from palpate.segmentation.working_grid import bounds

# Largest relative change of the prostate's volume between the states without a note: the organ is incompressible.
VOLUME_CHANGE = 0.15


@dataclass(frozen=True, eq=False)
class SegmentedState:
    """One segmented state, a person's contours of it, the grid that its labels are written on, and how far the surfaces of
    the organs that the program found may be off."""

    segmentation: Segmentation
    contours: Contours | None
    grid: Volume
    errors: Mapping[str, SurfaceErrors] = field(default_factory=dict)

    def mask(self, name: str) -> BoolArray:
        """Mask of an organ, "bone" or "body" on the grid that is written. A person's voxels are unchanged."""
        contours = self.contours
        if contours is not None and name in contours.organs and self.grid is contours.volume:
            return np.asarray(contours.organs[name].array)
        segmented = self.segmentation.mask(name, self.grid)
        return segmented | contours.bone_on(self.grid) if name == "bone" and contours is not None else segmented

    @property
    def prostate(self) -> Volume:
        """The mask of the prostate."""
        return self.grid.with_array(self.mask("prostate"))


def state_report(part: SegmentedState, labels: Volume, plane: Plane, box: FloatArray) -> SegmentedRecord:
    """Record of one state. labels : as written. box : (2, 3) mm, corners of the region that the labels should cover."""
    organs = part.segmentation.organs
    low, high = bounds(labels)
    whole = {name: round(part.segmentation.scene.cc(found.mask), 2) for name, found in organs.items()}
    return {
        "organs": {name: _organ_record(found, whole[name], part.errors.get(name)) for name, found in organs.items()},
        "bones": {
            name: {"volume_cc": round(part.segmentation.bones.volume_cc(name), 2), "confidence": confidence}
            for name, confidence in part.segmentation.bones.confidence.items()
        },
        "femoral_heads": {
            side: {
                "centre_mm": [round(float(x), 2) for x in head.centre],
                "radius_mm": round(head.radius_mm, 2),
                "seen": round(head.seen, 3),
            }
            for side, head in part.segmentation.bones.heads.items()
        },
        "bone": {
            "method": "threshold" if part.contours is None or part.contours.bone is None else "threshold and user"
        },
        "volume_in_region_cc": volumes_cc(labels),
        "split": {"point": plane.point.tolist(), "normal": plane.normal.tolist(), "source": plane.source},
        "spacing_mm": labels.spacing.tolist(),
        "covers_region": bool((low <= box[0] + labels.spacing).all() and (high >= box[1] - labels.spacing).all()),
    }


def volumes_cc(labels: Volume) -> dict[str, float]:
    """Volume of the voxels of each label, cc, by its name."""
    voxel_cc = float(np.prod(labels.spacing)) / 1000.0
    return {name: round(float((labels.array == value).sum()) * voxel_cc, 2) for value, name in LABELS.items() if value}


def _organ_record(found: Found, volume_cc: float, errors: SurfaceErrors | None) -> OrganRecord:
    """confidence : of an organ that the program found, the Dice with the true one that its errors leave on average."""
    if errors is None:
        return {"method": found.method, "confidence": found.confidence, "volume_cc": volume_cc}
    return {
        "method": found.method,
        "confidence": round(errors.expected_dice, 3),
        "volume_cc": volume_cc,
        "error_mm": round(rms(errors.sd_mm), 2),
    }


def carried_record(source: OrganRecord, carried: OrganRecord) -> OrganRecord:
    """Record of an organ that was carried over: it errs as in the scan that it comes from, and by what carried it."""
    both = float(np.hypot(source.get("error_mm", 0.0), carried["error_mm"]))
    sure = round(source["confidence"] * carried["confidence"], 3)
    return {**carried, "confidence": sure, "error_mm": round(both, 2)}


def notes_on(states: Mapping[str, SegmentedRecord]) -> list[str]:
    """Notes for the user on what to check, a line each."""
    notes = []
    for state, facts in states.items():
        for organ in ("prostate", "bladder", "rectum"):
            known = facts["organs"].get(organ)
            if known is None:
                notes.append(f"{state}: no {organ} was found; click on it with --seed {organ}=x,y,z where there is one")
            elif known["confidence"] < DOUBTFUL:
                notes.append(
                    f"{state}: the {organ} is doubtful (confidence {known['confidence']:.2f}); look at it (palpate open CASE), "
                    f"or click on it with --seed {organ}=x,y,z"
                )
        if not facts["covers_region"]:
            notes.append(f"{state}: the scan ends within the region around the prostate; the model is cut off there")
    if len(states) < len(STATES):
        return notes
    rest, deformed = (states[state]["organs"]["prostate"]["volume_cc"] for state in STATES)
    if abs(deformed / rest - 1.0) > VOLUME_CHANGE:
        notes.append(f"the prostate is {rest:.0f} cc at rest and {deformed:.0f} cc deformed; look at both contours")
    return notes
