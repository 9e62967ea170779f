"""The label values of a case (docs/case.md) and the colours they are drawn in."""

from __future__ import annotations

LABELS: dict[int, str] = {
    0: "outside",
    1: "prostate_left",
    2: "prostate_right",
    3: "surrounding_tissue",
    4: "bone",
    5: "bladder",
    6: "rectum",
}

LABEL_VALUES: dict[str, int] = {name: value for value, name in LABELS.items()}

OUTSIDE, PROSTATE_LEFT, PROSTATE_RIGHT, SURROUNDING_TISSUE, BONE, BLADDER, RECTUM = range(7)

ORGAN_LABELS: tuple[int, ...] = (PROSTATE_LEFT, PROSTATE_RIGHT)

# The one palette of labels, in every picture, window and file: red, green, blue (0 to 255) and opacity (0 to 1), as the label
# description file of ITK-SNAP holds them. Organs in colours that the colour-blind tell apart: vermillion, bluish green, yellow and
# reddish purple of B. Wong, "Points of view: Color blindness", Nature Methods 8, 441 (2011). Bone is ivory, as everywhere.
LABEL_COLOURS: dict[int, tuple[int, int, int, float]] = {
    0: (0, 0, 0, 0.0),
    1: (213, 94, 0, 1.0),
    2: (0, 158, 115, 1.0),
    3: (255, 220, 170, 0.3),
    4: (240, 240, 210, 1.0),
    5: (240, 228, 66, 1.0),
    6: (204, 121, 167, 1.0),
}

# The parts of label 4 in STATE_bones.nii.gz: rigid as one in the model, told apart for the eye and for the alignment.
BONE_PARTS: dict[int, str] = {
    1: "femur_left",
    2: "femur_right",
    3: "hip_left",
    4: "hip_right",
    5: "sacrum",
    6: "spine",
}

BONE_PART_VALUES: dict[str, int] = {name: value for value, name in BONE_PARTS.items()}

BONE_PART_COLOURS: dict[int, tuple[int, int, int, float]] = {
    0: (0, 0, 0, 0.0),
    1: (31, 119, 180, 1.0),
    2: (255, 127, 14, 1.0),
    3: (44, 160, 44, 1.0),
    4: (214, 39, 40, 1.0),
    5: (148, 103, 189, 1.0),
    6: (140, 86, 75, 1.0),
}
