"""The segment step of a case: both scans, and a person's contours of them, to label volumes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.imported import holds_rest_alone
from palpate.case.step_records import SegmentationRecord, SegmentedRecord
from palpate.case.steps.carried_over import OtherScan, prompts_of
from palpate.case.steps.declarations import SEGMENT
from palpate.case.steps.returned_labels import ReturnedLabels, are_drawn, compared, returned_volumes, take_over
from palpate.case.steps.segment_options import SegmentOptions
from palpate.case.steps.segment_report import SegmentedState, carried_record, notes_on, state_report, volumes_cc
from palpate.case.steps.segment_state import segmented, segmented_beside
from palpate.case.surface_errors import write_surface_errors
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.worker.executors import one_thread
from palpate.core.worker.progress import Progress, part, silent
from palpate.imaging.contours.itksnap_labels import label_description
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.labels import BONE, BONE_PART_COLOURS, BONE_PARTS, ORGAN_LABELS
from palpate.imaging.volume import Volume
from palpate.segmentation.bone.motion import bone_motions, motion_notes
from palpate.segmentation.pelvis import Segmentation
from palpate.segmentation.prostate.halves import Plane, halves, midline_normal, split_plane
from palpate.segmentation.surface_error import SurfaceErrors
from palpate.segmentation.tissue import cropped, label_array, region_of_interest

# Margin of the deformed labels around the region that is modelled at rest: surfaces must be whole there.
DEFORMED_ROOM_MM = 10.0


def run_segment(
    case: CaseFolder, options: SegmentOptions | None = None, progress: Progress = silent, workers: int = 1
) -> SegmentationRecord:
    """Write rest.nii.gz, deformed.nii.gz (both in the rest frame), labels.txt and segmentation.json; return the last.

    surface_errors.npz gives, by place, how far the surfaces that were found may be off. STATE_bones.nii.gz (names in
    bones.txt) gives the bone of each bone voxel.

    A person's contours (STATE_user.nii.gz) are taken as they are; only missing structures are segmented. What nobody drew or
    pointed at in one scan is carried over from the other by the motion that both CTs show, drawn or found. The step
    passes over a case whose scans, contours and options are those of the last run, and over a case that came with label
    volumes. workers : processes; with more than one both scans are segmented side by side, with the same labels.

    Raises InputError when there is nothing to segment, the scans show no pelvis, or no prostate is found.
    """
    options = options or SegmentOptions()
    made_from = SEGMENT.made_from(case, options.to_dict())
    if SEGMENT.is_done(case, made_from):
        report: SegmentationRecord = case.read_json("segmentation.json")
        return report
    alone = holds_rest_alone(case)
    states = STATES[:1] if alone else STATES
    came_with_labels = all(case.has_labels(state) for state in states) and not case.has("segmentation.json")
    if came_with_labels or not all(case.has(f"{state}_ct") for state in states):
        return _labels_alone(case, progress, states)
    report = _write(case, _segmented_case(case, options, progress, alone, workers))
    SEGMENT.mark_done(case, made_from, [n for n in SEGMENT.writes if not (alone and n.startswith("deformed"))])
    progress(1.0, "labels written")
    return report


def _segmented_case(
    case: CaseFolder, options: SegmentOptions, progress: Progress, alone: bool, workers: int
) -> _Labelled:
    """Labels of a case from its scans and from a person's contours, or from the scans and what was changed in labels that
    this program had exported.
    """
    given = returned_volumes(case)
    if given:
        try:
            found = _labelled(
                case, *_found(case, options, part(progress, 0.0, 0.5), alone, workers, drawn=False), options
            )
        except InputError:  # nothing to compare with; the contours may do without
            return _labelled(case, *_found(case, options, part(progress, 0.5, 1.0), alone, workers), options)
        returned = {state: compared(found.volumes[state], volume, case.ct(state)) for state, volume in given.items()}
        if not are_drawn(returned):
            return found.with_changes(returned)
    ways = part(progress, 0.5, 1.0) if given else progress
    return _labelled(case, *_found(case, options, ways, alone, workers), options)


def _found(
    case: CaseFolder, options: SegmentOptions, progress: Progress, alone: bool, workers: int, drawn: bool = True
) -> tuple[dict[str, SegmentedState], OtherScan]:
    """Segmentation of both states, or of the scan at rest where there is no other; and what was carried over.

    The scan that leads comes first. With more than one worker the other one is read beside it, and segmented beside its
    errors: it is led to the prostate, or its organs are carried over. drawn : whether a person's contours count.
    """
    other = OtherScan.of(case, options, drawn)
    first, second = other.order
    mine = part(progress, 0.0, 0.45 if workers <= 1 else 0.9)

    def first_of(then: Callable[[Segmentation], None]) -> SegmentedState:
        prompts = prompts_of(case, options, first)
        return segmented(case, first, prompts, options.model, lambda f, m: mine(f, f"{first}: {m}"), then, drawn=drawn)

    with one_thread():  # the order of sums must not depend on the number of cores
        if alone:
            return {"rest": first_of(lambda _: None)}, other
        if workers <= 1:
            found = first_of(lambda _: None)
            carried = other.carried(found.segmentation, part(progress, 0.45, 0.6))
            told, prompts = part(progress, 0.6, 0.9), other.prompts(found.segmentation)
            made = segmented(
                case,
                second,
                prompts,
                options.model,
                lambda f, m: told(f, f"{second}: {m}"),
                carried=carried,
                drawn=drawn,
            )
            return _by_state({first: found, second: made}), other
        with segmented_beside(case, second, drawn) as beside:
            found = first_of(lambda s: beside.begin(other.prompts(s), options.model, other.carried(s, silent)))
            progress(0.85, second)
            return _by_state({first: found, second: beside.result()}), other


def _by_state(found: Mapping[str, SegmentedState]) -> dict[str, SegmentedState]:
    return {state: found[state] for state in STATES}


@dataclass(frozen=True, eq=False)
class _Labelled:
    """Labels and bones by state, the report, and errors of the surfaces by state and organ, before they are written.

    one_drawing : organs of one scan, of the state `drawn_in`, that were carried over to the other.
    """

    volumes: dict[str, Volume]
    bones: dict[str, Volume]
    report: SegmentationRecord
    errors: dict[str, dict[str, SurfaceErrors]]
    one_drawing: tuple[str, ...]
    drawn_in: str

    def with_changes(self, returned: Mapping[str, ReturnedLabels]) -> _Labelled:
        """The same with what a person changed in exported labels."""
        for state, one in returned.items():
            record = self.report["states"][state]
            take_over(state, one, record["organs"], self.errors[state], self.report["notes"])
            self.volumes[state] = one.labels
            record["volume_in_region_cc"] = volumes_cc(one.labels)
            if "bone" in one.changed:
                record["bone"] = {"method": "threshold and user"}
            bone = one.labels.array == BONE
            self.bones[state] = self.bones[state].with_array(
                np.where(bone, self.bones[state].array, 0).astype(np.uint8)
            )
        return self


def _labelled(
    case: CaseFolder, found: Mapping[str, SegmentedState], carried_over: OtherScan, options: SegmentOptions
) -> _Labelled:
    rest = found["rest"]
    normal, source = midline_normal(rest.segmentation.scene.pelvis)
    roi = region_of_interest(rest.prostate, np.array(options.margin_mm))
    states: dict[str, SegmentedRecord] = {}
    volumes = {}
    for state, one in found.items():
        box = roi if state == "rest" else roi + DEFORMED_ROOM_MM * np.array([[-1.0], [1.0]])
        plane = split_plane(one.prostate, normal, source, prompts_of(case, options, state).seeds.get("urethra"))
        volumes[state] = labels_of(one, plane, box)
        states[state] = state_report(one, volumes[state], plane, box)
    first, second = carried_over.order
    for name in carried_over.names:
        organs = states[second]["organs"]
        organs[name] = carried_record(states[first]["organs"][name], organs[name])
    other = found.get("deformed")
    motions = bone_motions(rest.segmentation.bones, other.segmentation.bones) if other else {}
    report: SegmentationRecord = {
        "region_of_interest_mm": roi.tolist(),
        "states": states,
        "bone_motion": {name: motion.to_dict() for name, motion in motions.items()},
        "notes": carried_over.notes + notes_on(states) + motion_notes(motions),
    }
    errors = {state: dict(one.errors) for state, one in found.items()}
    bones = {state: bones_of(found[state], labels) for state, labels in volumes.items()}
    return _Labelled(volumes, bones, report, errors, carried_over.names, carried_over.order[0])


def _write(case: CaseFolder, made: _Labelled) -> SegmentationRecord:
    write_surface_errors(case, made.errors, made.one_drawing, made.volumes, made.drawn_in)
    # The report comes first: labels without one count as a person's own, which those of a killed run are not.
    case.write_json("segmentation.json", made.report)
    for state, bones in made.bones.items():
        with case.atomic_path(f"{state}_bones.nii.gz") as path:
            write_labels(path, bones)
    with case.atomic_path("bones.txt") as path:
        path.write_text(label_description(BONE_PARTS, BONE_PART_COLOURS), encoding="utf-8")
    for state, labels in made.volumes.items():
        case.write_labels(state, labels)
    written: SegmentationRecord = case.read_json("segmentation.json")
    return written


def labels_of(part: SegmentedState, plane: Plane, box: FloatArray) -> Volume:
    """Labels of a segmented scan within a box (2, 3), mm. Left and right are those of the contours, else divided by the
    plane.
    """
    contoured = part.contours.prostate_labels if part.contours is not None else None
    sides = halves(part.prostate, plane) if contoured is None else contoured
    masks = {name: part.mask(name) for name in (*part.segmentation.organs, "bone") if name != "prostate"}
    body = part.mask("body")
    near = cropped(part.grid.with_array(np.arange(part.grid.array.size).reshape(part.grid.array.shape)), box)
    pick = near.array
    chosen = {name: mask.ravel()[pick] for name, mask in masks.items()}
    return near.with_array(label_array(sides.ravel()[pick], chosen, body.ravel()[pick]))


def bones_of(part: SegmentedState, labels: Volume) -> Volume:
    """Bone (values of BONE_PARTS) of each voxel that is labelled bone."""
    return labels.with_array(part.segmentation.bones.on(labels, labels.array == BONE))


def _labels_alone(case: CaseFolder, progress: Progress, states: tuple[str, ...]) -> SegmentationRecord:
    """Report of a case that came with label volumes: there is nothing to segment."""
    missing = [case.file(f"{state}_ct") for state in states if not case.has(f"{state}_ct")]
    if not all(case.has_labels(state) for state in states):
        raise InputError(f"{missing[0]} is not there and there are no label volumes; import the scans first")
    volumes = {state: case.labels(state) for state in states}
    for state, labels in volumes.items():
        if not np.isin(labels.array, ORGAN_LABELS).any():
            raise InputError(f"{case.file(state + '.nii.gz')} holds no prostate (labels 1, 2); draw it")
    progress(1.0, "label volumes are there already")
    return {"states": {state: {"source": "label volumes"} for state in states}, "notes": []}
