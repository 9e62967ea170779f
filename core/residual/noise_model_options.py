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
_REPLACED = "Starting value only, for the weights of the first fit: the case's own estimate takes its place."


@dataclass(frozen=True, kw_only=True)
class NoiseModelOptions:
    """Sizes and lengths of everything in the data that is no effect."""

    contour: Annotated[
        float, sourced("1", "Contour noise over what the case states, before it is estimated.", _REPLACED)
    ] = 1.0
    length_mm: Annotated[
        float, sourced("mm", "Correlation length of contour noise, before it is estimated.", _REPLACED)
    ] = 7.0
    own_mm: Annotated[
        float, sourced("mm", "Error of every surface mode from voxels, before it is estimated.", _REPLACED)
    ] = 0.3
    along: Annotated[
        float,
        sourced(
            "1",
            "Factor on what `WallMotion` leaves unknown of the walls' motion along themselves.",
            "Nine effect-free cases of the blind check (seeds 4 and 5): mean squares of what walls read wrongly move "
            "the organ by are 0.97 "
            "(rectum) and 0.6 (bladder) times those that are said, in single cases up to five times "
            "(tests/benchmarks/slides.py).",
        ),
    ] = 1.0
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
            "Correlation lengths of contour noise that are told apart.",
            "Chosen: around the 5.0 to 7.8 mm of the shared sets; the data choose among them by restricted likelihood. "
            "The blind check draws its own for each case. With 486 sizes in place of the 135 of all lists ln G of shared "
            "case 304 moves by 0.08 of its standard deviation.",
        ),
    ] = (4.0, 6.0, 9.0)
    long_mm: Annotated[
        float,
        sourced(
            "mm",
            "Correlation length of the part of contour noise that goes together over a side of the organ.",
            "Chosen: about a third of a prostate's width. Contours that people draw err in their details and, over a side, alike; "
            "of 19 effect-free cases three had p below 0.05 with one length alone, one with this part.",
        ),
    ] = 14.0
    long_shares: Annotated[
        tuple[float, ...],
        sourced(
            "1",
            "Shares of the contour noise's variance with that length that are told apart.",
            "Chosen: from none to more than half; the data choose among them.",
        ),
    ] = (0.0, 0.3, 0.6)
    contour_factors: Annotated[
        tuple[float, ...],
        sourced(
            "1",
            "Sizes of contour noise over what the case states that are told apart.",
            "Chosen: from under the half that is true of the first shared set to a fifth more than stated; the data "
            "choose among them.",
        ),
    ] = (0.4, 0.6, 0.8, 1.0, 1.2)
    estimated_factors: Annotated[
        tuple[float, ...],
        sourced(
            "1",
            "Sizes of contour noise that are told apart where it was estimated from the image, over the estimate.",
            "Chosen: a factor of two to both sides, as an estimate errs to both; the data choose among them.",
        ),
    ] = (0.5, 0.7, 1.0, 1.4, 2.0)
    contour_prior: Annotated[
        float,
        sourced(
            "1",
            "Standard deviation of ln (true contour noise / what the case states).",
            "Chosen: what is stated is believed to a factor of 1.4; the first shared set has half of what it states.",
        ),
    ] = 0.35
    own_sizes_mm: Annotated[
        tuple[float, ...],
        sourced(
            "mm",
            "Sizes of every surface mode's error from voxels that are told apart.",
            "From below to above 0.37 to 0.57 mm a mode, which was measured on five effect-free patients of the blind check's seed "
            "11 drawn without contour noise.",
        ),
    ] = (0.2, 0.35, 0.6)
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
            "Correlation length of a nameless missing force.",
            f"Chosen. {_TRIED}",
        ),
    ] = 12.0
    force_reach_mm: Annotated[
        float,
        sourced(
            "mm",
            "How far around the organ missing forces are looked for.",
            f"Chosen: one correlation length of them. {_TRIED}",
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
    free_offset_mm: Annotated[
        float,
        sourced(
            "mm",
            "How far a contour may be offset while the noise is estimated.",
            "Chosen: a little more than the prior of `contour_bias` (0.8 mm), so that it is not taken for noise. "
            f"{_TRIED}",
        ),
    ] = 1.0
    free_bones: Annotated[
        float,
        sourced(
            "mm, degrees",
            "How far bones may have moved while the noise is estimated.",
            "Chosen: twice the prior of `bone_motion` (2 mm, 2.5 degrees) and more, so that it is not taken for "
            f"noise. {_TRIED}",
        ),
    ] = 5.0
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
        sourced("mm an axis", "Motion of the region's edge, which the model holds, before it is estimated.", _REPLACED),
    ] = 1.0
    edge_sizes_mm: Annotated[
        tuple[float, ...],
        sourced(
            "mm an axis",
            "Sizes of the motion of the region's edge that are told apart, where images show the motion.",
            "Chosen: from none to what a full rectum moves 6 cm away; the data choose.",
        ),
    ] = (0.0, 0.5, 1.0, 2.0, 4.0)
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
        sourced("mm an axis", "Displacement that the model cannot predict, before it is estimated.", _REPLACED),
    ] = 0.2
    local_length_mm: Annotated[
        float,
        sourced("mm", "Correlation length of that displacement, before it is estimated.", _REPLACED),
    ] = 10.0
    local_sizes_mm: Annotated[
        tuple[float, ...],
        sourced(
            "mm an axis",
            "Sizes of the displacement that the model cannot predict that are told apart, where images show the motion.",
            "Chosen: from below what elements err by to what a tissue of another stiffness does; the data choose.",
        ),
    ] = (0.05, 0.1, 0.15, 0.2, 0.3, 0.45, 0.7)
    local_lengths_mm: Annotated[
        tuple[float, ...],
        sourced(
            "mm",
            "Correlation lengths of that displacement that are told apart.",
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
        """The same numbers; where surfaces state their own errors, lengths and factors are those of estimated errors."""
        if not problem.states_errors:
            return self
        longer = problem.facts.noise_correlation_mm / self.length_mm
        return replace(
            self,
            length_mm=problem.facts.noise_correlation_mm,
            lengths_mm=tuple(longer * length for length in self.lengths_mm),
            long_mm=longer * self.long_mm,
            contour_factors=self.estimated_factors,
        )
