"""What the steps' JSON files hold: import.json, surfaces.json, alignment.json, segmentation.json and state.json
(docs/case.md).
"""

from __future__ import annotations

from typing import NotRequired, TypedDict


class ImportRecord(TypedDict, total=False):
    """import.json. sources_sha256 : of what was imported, by state. residual_mm : of the bones once aligned, rms; None
    without an alignment. aligned_by : "registration" where a DICOM registration was given, absent where the bones were used.

    An import that was cut short has left the first two keys alone; one of surfaces notes no residual.
    """

    case: str
    sources_sha256: dict[str, str]
    residual_mm: float | None
    aligned_by: str
    notes: list[str]


class SurfacesRecord(TypedDict):
    """surfaces.json: what a pair of closed surfaces tells. volume_cc : by state. surface_rms_mm, landmarks : by way of
    moving the inside.

    landmarks : distances, mm; None without landmarks. cannot_tell, next, in_words, notes : for a person.
    landmarks_as_given_rms_mm : as the files have them, before the alignment.
    """

    case: str
    volume_cc: dict[str, float]
    turned_deg: float
    surface_rms_mm: dict[str, float]
    landmarks: dict[str, dict[str, object]] | None
    cannot_tell: str
    next: str
    in_words: list[str]
    notes: list[str]
    landmarks_as_given_rms_mm: float | None


class AlignmentRecord(TypedDict, total=False):
    """alignment.json. deformed_to_rest : rigid, (4, 4), LPS mm. residual_mm : rms on bone, of parts of the pelvis
    beside; None where no alignment was made. unmatched, overlap : as in `Alignment`.
    """

    deformed_to_rest: list[list[float]]
    residual_mm: float | None
    part_residual_mm: dict[str, float]
    unmatched: float
    overlap: float
    notes: list[str]


class OrganRecord(TypedDict):
    """How an organ was found, how sure that is, 0 to 1, and its volume, cc; a file made by hand may tell the method
    alone. error_mm : of its surface along the normal, rms, where it was estimated.
    """

    method: str
    confidence: NotRequired[float]
    volume_cc: NotRequired[float]
    error_mm: NotRequired[float]


class BoneRecord(TypedDict):
    """Volume of one bone, cc, and how surely it was told apart, 0 to 1."""

    volume_cc: float
    confidence: float


class FemoralHeadRecord(TypedDict):
    """The ball that fits a femoral head: centre, mm, LPS in the rest frame; radius; share of its surface that shows, 0 to
    1.
    """

    centre_mm: list[float]
    radius_mm: float
    seen: float


class SplitRecord(TypedDict):
    """The plane between left and right: a point, mm, the unit normal to the patient's left, and how it was found."""

    point: list[float]
    normal: list[float]
    source: str


class SegmentedRecord(TypedDict, total=False):
    """One state in segmentation.json. femoral_heads : by side. volume_in_region_cc : of the labels as written. source :
    of labels that came with the case, alone.
    """

    organs: dict[str, OrganRecord]
    bones: dict[str, BoneRecord]
    bone: OrganRecord
    femoral_heads: dict[str, FemoralHeadRecord]
    volume_in_region_cc: dict[str, float]
    split: SplitRecord
    spacing_mm: list[float]
    covers_region: bool
    source: str


class SegmentationRecord(TypedDict, total=False):
    """segmentation.json. region_of_interest_mm : two corners, LPS. bone_motion : of each bone between the states."""

    region_of_interest_mm: list[list[float]]
    states: dict[str, SegmentedRecord]
    bone_motion: dict[str, dict[str, object]]
    notes: list[str]


class StepRecord(TypedDict, total=False):
    """One step in state.json. outputs : files that it wrote. inputs : SHA-256 by file that it read. program : what
    identifies it.
    """

    inputs_sha256: str
    outputs: list[str]
    done: bool
    inputs: dict[str, str]
    program: str
