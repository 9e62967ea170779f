"""The label values of a case (CASE_FORMAT.md) and the colours they are drawn in."""

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

# Red, green, blue (0 to 255) and opacity (0 to 1), as the label description file of ITK-SNAP holds them.
LABEL_COLOURS: dict[int, tuple[int, int, int, float]] = {
    0: (0, 0, 0, 0.0),
    1: (255, 0, 0, 1.0),
    2: (0, 255, 0, 1.0),
    3: (255, 220, 170, 0.3),
    4: (240, 240, 210, 1.0),
    5: (255, 255, 0, 1.0),
    6: (160, 90, 40, 1.0),
}
