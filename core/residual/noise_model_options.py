"""What is taken to be known of the data's errors: the noise covariance's numbers, each with its source."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from palpate.core.problem import IdentificationProblem
from palpate.core.sourced_number import sourced

_GAP_NOISE = (
    "Likeliest together with the other two of mesh, offset and model on 88 effect-free cases of the blind check, "
    "seeds 9 and 11 to 14 "
    "(restricted likelihood; tests/benchmarks/gap_noise.py)."
)
_TRIED = (
    "Half as much again, or twice, with the others so marked: the probability of shared case 310 falls from 0.97 to "
    "0.95 and ln G moves by "
    "0.01 (tests/benchmarks/chosen_numbers.py)."
)


@dataclass(frozen=True, kw_only=True)
class NoiseModelOptions:
    """Sizes and lengths of everything in the data that is no effect."""

    own_mm: Annotated[
        float,
        sourced(
            "mm",
            "Error of every surface mode from voxels: the median of its prior.",
            "A little below the 0.37 to 0.57 mm a mode that five effect-free patients of the blind check's seed 11 have, drawn without "
            "contour noise.",
        ),
    ] = 0.35
    landmark_mm: Annotated[
        float,
        sourced(
            "mm an axis",
            "Error of a landmark's motion.",
            "Chosen: about 0.3 mm an axis in each scan. The blind check draws 0.2 to 0.6 mm for each case.",
        ),
    ] = 0.45
    mesh: Annotated[
        float,
        sourced("1", "Share of the difference between two elements that may be left in the better one.", _GAP_NOISE),
    ] = 0.3
    unsolved_mesh_mm: Annotated[
        float,
        sourced(
            "mm rms",
            "Smooth error of the quick element where the better one finds no equilibrium.",
            "About what the better element changes where it does; `coarse_mm` flags 0.35 as too much.",
        ),
    ] = 0.25
    offset_mm: Annotated[
        float, sourced("mm", "Offset of one scan's whole contour beyond what its noise adds up to.", _GAP_NOISE)
    ] = 0.03
    model: Annotated[
        float,
        sourced("1", "Smooth error of the model itself, over a gap of typical size (`force_typical_mm`).", _GAP_NOISE),
    ] = 0.1
    lengths_mm: Annotated[
        tuple[float, ...],
        sourced(
            "mm",
            "Correlation lengths among which the variance of contour noise is shared.",
            "Chosen: around the 5.0 to 7.8 mm of the shared sets, and a third of a prostate's width, for contours that people draw err "
            "alike over a side. The blind check draws its own for each case.",
        ),
    ] = (4.0, 6.0, 9.0, 14.0)
    contour_prior: Annotated[
        float,
        sourced(
            "1",
            "Standard deviation of ln (true contour noise / what the case states), and of ln (error of every mode / its median).",
            "Chosen: both are believed to a factor of 1.4; the first shared set has half of what it states.",
        ),
    ] = 0.35
    size_spread: Annotated[
        float,
        sourced(
            "1",
            "Standard deviation of ln (size / its median) of every other part of the noise.",
            "Chosen: each is known to a factor of two; the data choose.",
        ),
    ] = 0.7
    length_spread: Annotated[
        float,
        sourced(
            "1",
            "Standard deviation of the logits by which a part's variance is shared among its correlation lengths.",
            "Chosen: in one case of two a single length has three fifths of the variance.",
        ),
    ] = 1.5
    points: Annotated[
        int,
        sourced("1", "Points of the noise's sizes with a nameless gap, and as many without one.", "Numerical."),
    ] = 16
    voxel_length_mm: Annotated[
        float,
        sourced(
            "mm",
            "Length over which draws of the organ's voxel errors are taken to be correlated (Houtekamer & Mitchell 2001).",
            "Chosen: four times the width of the filter that smooths a label (2.5 mm). On two pelves, 6, 10, 15 and 25 mm left "
            "0.07 to 0.09 in ln G of draws that the covariance was not made from.",
        ),
    ] = 10.0
    gap_sizes: Annotated[
        tuple[float, ...],
        sourced(
            "1",
            "Sizes of a nameless gap, over its typical one, that are averaged over; 0 is no gap.",
            "Chosen: from a quarter to twice. With one size alone three of five effect-free cases whose walls slid "
            "raised an alarm.",
        ),
    ] = (0.0, 0.25, 0.5, 1.0, 2.0)
    force_length_mm: Annotated[
        float,
        sourced(
            "mm",
            "Correlation length of a nameless missing force, and how far around the organ one is looked for.",
            f"Chosen. {_TRIED}",
        ),
    ] = 12.0
    force_typical_mm: Annotated[
        float,
        sourced(
            "mm rms",
            "Motion of the organ's surface along its normal that a nameless gap of typical size causes.",
            "Chosen: its size is averaged over by `gap_sizes`, from 0.15 to 1.2 mm.",
        ),
    ] = 0.6
    shape_length_mm: Annotated[
        float,
        sourced(
            "mm",
            "Correlation length of an error of the contour that is no noise.",
            f"Chosen: longer than noise is ever taken to be. {_TRIED}",
        ),
    ] = 20.0
    mode_length_mm: Annotated[
        float,
        sourced(
            "mm",
            "Correlation length whose covariance's modes the organ's surface is read in.",
            "Chosen: about that of contour noise, so that what is left out is finer than any effect.",
        ),
    ] = 7.0
    mode_least: Annotated[
        float,
        sourced(
            "1", "Smallest variance of a mode that is read, over the largest.", "Chosen: 65 to 75 modes for a prostate."
        ),
    ] = 0.01
    bone_floor_mm: Annotated[
        float,
        sourced("mm an axis", "What no registration of bones is better than.", f"Chosen. {_TRIED}"),
    ] = 0.15
    bone_floor_deg: Annotated[
        float,
        sourced(
            "degrees an axis",
            "The same of a rotation.",
            f"Chosen: moves a point 43 mm away by 0.15 mm. {_TRIED}",
        ),
    ] = 0.2
    bone_far_mm: Annotated[
        float,
        sourced(
            "mm",
            "Distance between a bone's two surfaces beyond which it is where a scan ends, not where a bone went.",
            f"Chosen: farther than bones of aligned scans move (prior 2 mm, 2.5 degrees). {_TRIED}",
        ),
    ] = 12.0
    edge_mm: Annotated[
        float,
        sourced(
            "mm an axis",
            "Motion of the region's edge, which the model holds: the median of its prior, where images show the motion.",
            "Chosen: a full rectum moves what lies 6 cm away by up to 4 mm.",
        ),
    ] = 1.0
    edge_length_mm: Annotated[
        float,
        sourced(
            "mm",
            "Correlation length of the motion of the region's edge.",
            "Chosen: half of its distance from the organ; what is finer at the edge does not reach the organ.",
        ),
    ] = 25.0
    local_mm: Annotated[
        float,
        sourced(
            "mm an axis",
            "Displacement that the model cannot predict: the median of its prior, where images show the motion.",
            "Chosen: more than elements err by, less than a tissue of another stiffness does.",
        ),
    ] = 0.2
    local_lengths_mm: Annotated[
        tuple[float, ...],
        sourced(
            "mm",
            "Correlation lengths among which the variance of that displacement is shared.",
            "Chosen: from an element's edge to an organ's size; the data choose.",
        ),
    ] = (6.0, 10.0, 16.0, 25.0)
    patch_nugget_mm: Annotated[
        float,
        sourced(
            "mm",
            "Independent error of each point of the organ that is left out.",
            "Numerical: keeps the covariance of points invertible, which are read from fewer modes.",
        ),
    ] = 0.1
    markers_common: Annotated[
        float,
        sourced(
            "1",
            "Share of a marker's variance, on a bench, that all markers on holders have in common in a state.",
            "Chosen: they sit on one holder, and its pose errs as a whole.",
        ),
    ] = 0.7

    def for_case(self, problem: IdentificationProblem) -> NoiseModelOptions:
        """The same numbers; where surfaces state their own errors, lengths are those of estimated errors."""
        if not problem.states_errors:
            return self
        longer = problem.facts.noise_correlation_mm / self.mode_length_mm
        return replace(self, lengths_mm=tuple(longer * length for length in self.lengths_mm))
