"""What a case lacks, in the words that stand before its results: a wall that was not found, an organ cut off, a bound."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.meshed import ORGAN_NAME, MeshReport
from palpate.case.surface_errors import StatedErrors
from palpate.core.identify.result_record import RegionRecord
from palpate.imaging.labels import BLADDER, ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume

# How the line begins that says that nobody drew the prostate.
AUTOMATIC_CONTOURS = "contours of the prostate that somebody drew or checked"
# What a case lacks whose prostate was drawn in one scan only.
CARRIED_OVER = (
    "contours of the prostate that were drawn in both scans: those of one scan were carried over by what the images show, and where these "
    "show little they follow the walls as soft tissue would. Correct them; until then the stiffness comes out too low"
)
# The same where the fit stands on the images themselves.
CARRIED_BY_IMAGES = (
    "contours of the prostate that were drawn in both scans: the stiffness comes from what the images show about the prostate, and its "
    "interval is wide. Contours in the other scan would narrow it"
)
_WALLS = {"rectum": RECTUM, "bladder": BLADDER}
_SCANS = {"rest": "the scan at rest", "deformed": "the deformed scan"}


def missing_structures(case: CaseFolder, image: bool = False) -> list[str]:
    """What the labels of a case lack for a stiffness to be believed, one line each: rectum or bladder in a scan, part of the
    prostate beyond a scan's end. Nothing for a case without labels of both states. image : whether the motion that the images tell
    is used.

    Raises InputError when a label volume cannot be read.
    """
    if not all(case.has_labels(state) for state in STATES):
        return []
    volumes = {state: case.labels(state) for state in STATES}
    lines = automatic_contours(case, image)
    if not lines and StatedErrors(case).one_drawing(ORGAN_NAME):
        lines = [CARRIED_BY_IMAGES] if image else [CARRIED_OVER]
    lines += [line for name, label in _WALLS.items() if (line := _absent(case, volumes, name, label))]
    return lines + [
        f"the prostate reaches the end of {_SCANS[state]}: part of it may not be seen"
        for state, labels in volumes.items()
        if reaches_the_end(labels)
    ]


def automatic_contours(case: CaseFolder, image: bool) -> list[str]:
    """That nobody drew the prostate in a scan, and what its contour is then taken for. image : see `missing_structures`."""
    errors = StatedErrors(case)
    found = [state for state in STATES if errors.found_automatically(state, ORGAN_NAME)]
    carried = errors.one_drawing(ORGAN_NAME)
    if not found or (carried and len(found) < len(STATES)):
        return []
    said = errors.rms_mm()
    found = found[:1] if carried else found  # the other one errs as this one does
    sizes = [f"{said[state][ORGAN_NAME]:.1f} mm" for state in found if ORGAN_NAME in said.get(state, {})]
    where = "both scans" if len(found) == len(STATES) else _SCANS[found[0]]
    came = "were found automatically and carried over to the other" if carried else "were found automatically"
    motion = (
        "They only locate the prostate; its motion comes from the images"
        if image
        else "Its motion comes from them alone, and they hardly show it"
    )
    off = f", and may be off by {' and '.join(sizes)} rms" if sizes else ""
    return [f"{AUTOMATIC_CONTOURS}: those of {where} {came}{off}. {motion}"]


def at_bounds(parameters: Mapping[str, RegionRecord]) -> list[str]:
    """A line for each region whose stiffness ended at the edge of what was allowed. parameters : of result.json."""
    return [
        f"the stiffness of {name.replace('_', ' ')} ended at the edge of what was allowed: it is no measurement"
        for name, found in parameters.items()
        if found.at_bound
    ]


def reaches_the_end(labels: Volume) -> bool:
    """Whether voxels of the prostate lie in the first or last layer of a label volume along any axis."""
    organ = np.isin(labels.array, ORGAN_LABELS)
    return any(bool(organ.take(end, axis=axis).any()) for axis in range(3) for end in (0, -1))


def _absent(case: CaseFolder, volumes: Mapping[str, Volume], name: str, label: int) -> str:
    lacking = [state for state, labels in volumes.items() if not _shows(case, state, labels, name, label)]
    if not lacking:
        return ""
    where = "either scan" if len(lacking) == len(STATES) else _SCANS[lacking[0]]
    return (
        f"no {name} is known in {where}, so that its wall does not drive the model: what it did to the prostate is put down to "
        "stiffness or to another cause"
    )


def _shows(case: CaseFolder, state: str, labels: Volume, name: str, label: int) -> bool:
    """Whether a structure has a surface: a few voxels of it make none."""
    report: MeshReport = case.read_json("mesh.json") if case.has("mesh.json") else {}
    faces = report.get("surface_faces")
    return bool((labels.array == label).any()) and (faces is None or faces.get(f"{state}_{name}", 0) > 0)
