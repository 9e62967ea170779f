"""What segmentation.json says: by which method each label was found, how large and how sure it is, and what to look at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from palpate.case.case_folder import STATES
from palpate.case.drawn_labels import Drawn
from palpate.case.step_records import SegmentedRecord
from palpate.core.arrays import BoolArray, FloatArray
from palpate.imaging.labels import LABELS
from palpate.imaging.volume import Volume
from palpate.segmentation.pelvis import DOUBTFUL, Segmentation
from palpate.segmentation.prostate.halves import Plane
from palpate.segmentation.working_grid import bounds

# A prostate whose volume differs by more than this share between the states was not drawn alike: it is incompressible.
VOLUME_CHANGE = 0.15


@dataclass(frozen=True, eq=False)
class SegmentedState:
    """One state as segmented, what a person drew on it, and the grid that its labels are written on."""

    segmentation: Segmentation
    drawn: Drawn | None
    grid: Volume

    def mask(self, name: str) -> BoolArray:
        """An organ, "bone" or "body" on the grid that is written; voxels that a person drew as they were drawn."""
        if self.drawn is not None and name in self.drawn.organs and self.grid is self.drawn.volume:
            return np.asarray(self.drawn.organs[name].array)
        found = self.segmentation.mask(name, self.grid)
        return found | self.drawn.bone_on(self.grid) if name == "bone" and self.drawn is not None else found

    @property
    def prostate(self) -> Volume:
        """The mask of the prostate."""
        return self.grid.with_array(self.mask("prostate"))


def state_report(part: SegmentedState, labels: Volume, plane: Plane, box: FloatArray) -> SegmentedRecord:
    organs = part.segmentation.organs
    voxel_cc = float(np.prod(labels.spacing)) / 1000.0
    cc = {name: round(float((labels.array == value).sum()) * voxel_cc, 2) for value, name in LABELS.items() if value}
    low, high = bounds(labels)
    whole = {name: round(part.segmentation.scene.cc(found.mask), 2) for name, found in organs.items()}
    return {
        "organs": {
            name: {"method": found.method, "confidence": found.confidence, "volume_cc": whole[name]}
            for name, found in organs.items()
        },
        "bones": {
            name: {"volume_cc": round(part.segmentation.bones.volume_cc(name), 2), "confidence": confidence}
            for name, confidence in part.segmentation.bones.confidence.items()
        },
        "bone": {"method": "threshold" if part.drawn is None or part.drawn.bone is None else "threshold and user"},
        "volume_in_region_cc": cc,
        "split": {"point": plane.point.tolist(), "normal": plane.normal.tolist(), "source": plane.source},
        "spacing_mm": labels.spacing.tolist(),
        "covers_region": bool((low <= box[0] + labels.spacing).all() and (high >= box[1] - labels.spacing).all()),
    }


def notes_on(states: Mapping[str, SegmentedRecord]) -> list[str]:
    """What a person should look at, one line each."""
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
