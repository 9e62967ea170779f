"""What is taken to be known of how walls of hollow organs move: the numbers of `WallMotion`, each with its source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from palpate.core.sourced_number import sourced

_NINE = "nine effect-free cases of the blind check (seeds 4 and 5), whose walls' true motions are known"
_FIVE = "five effect-free cases of the blind check, whose walls' true motions are known"


@dataclass(frozen=True, kw_only=True)
class WallMotionOptions:
    """Priors of the walls' motion, and the noise of the surfaces it is learnt from."""

    noise_length_mm: Annotated[
        float,
        sourced(
            "mm",
            "Correlation length of the contours' noise along a wall.",
            "Chosen: people's contours err over some millimetres. The shared sets have "
            "5.0 to 7.8 mm; the blind check draws its own for each case.",
        ),
    ] = 6.5
    voxels_mm: Annotated[
        float,
        sourced(
            "mm",
            "Independent error of each point of a wall, from voxels.",
            "Chosen: near what surfaces cut from voxels err by on cases without contour noise, 0.16 to 0.20 mm rms (`EXTRACTION_MM` of "
            "core/observe/contour_noise.py), of which a part is correlated.",
        ),
    ] = 0.15
    smooth_mm: Annotated[
        float,
        sourced(
            "mm",
            "Length over which the normals of a wall are averaged.",
            "As far as the contours' noise is correlated: noise tilts normals, and a wall that slides along tilted normals fits noise. "
            f"Chosen with sections and weights on {_NINE}: what is read wrongly along the rectum then moves the organ by 0.18 mm rms "
            "instead of 0.27 (tests/benchmarks/slides.py).",
        ),
    ] = 6.0
    cauchy: Annotated[
        float,
        sourced(
            "standard deviations",
            "Distance from the likeliest motion at which a point's weight is halved.",
            "Usual constant of Cauchy's weights, 95 % efficient under normal errors (Holland & Welsch 1977).",
        ),
    ] = 2.385
    rounds: Annotated[
        int,
        sourced(
            "1",
            "How often the normals of a moved wall are taken anew.",
            "Chosen: each round fits a little more of the noise, so that more rounds read some simulated walls better and others worse.",
        ),
    ] = 4
    lengths_mm: Annotated[
        tuple[float, ...],
        sourced(
            "mm",
            "Correlation lengths of the motion along the normal among which the likeliest is taken.",
            "Chosen: steps of a fifth, from the length of a bulge to that of an organ; the data choose (Rasmussen & Williams 2006, 5.4).",
        ),
    ] = (10.0, 12.0, 14.0, 17.0, 20.0, 24.0, 29.0, 35.0)
    sizes_mm: Annotated[
        tuple[float, ...],
        sourced(
            "mm",
            "Standard deviations of the motion along the normal among which the likeliest is taken.",
            "Chosen: steps of a half, from what no scan shows to what folds the tissue; the data choose (Rasmussen & Williams 2006, 5.4).",
        ),
    ] = (1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 10.0)
    sideways_mm: Annotated[
        float,
        sourced(
            "mm an axis",
            "Standard deviation of any other smooth motion.",
            "The data do not tell 0.3 from 1 (evidence of eight walls: 3448.1 and 3449.7 in all). Where up to 8 was allowed a bladder "
            "drifted 11 mm along itself as normals were taken anew; with 1 and all axes alike, a rectum 5 mm.",
        ),
    ] = 0.7
    bag_mm: Annotated[
        float,
        sourced(
            "mm, an axis",
            "Standard deviation of a bag's translation, and (rms) of its growth in its own shape.",
            f"On {_FIVE}, 2 to 4 mm are much alike. Not asked of the data: across the wall a shift looks like a swelling to one side, "
            "and the likeliest size was often 0.",
        ),
    ] = 2.0
    section_moved_mm: Annotated[
        float,
        sourced(
            "mm an axis",
            "Standard deviation of how far the sections of a tube shift.",
            f"On {_FIVE}, 2 to 4 mm are much alike.",
        ),
    ] = 3.0
    section_length_mm: Annotated[
        float,
        sourced(
            "mm",
            "Length along a tube over which its sections shift together.",
            f"On {_FIVE}, 12 to 30 mm are much alike.",
        ),
    ] = 15.0
    bag_share: Annotated[
        float,
        sourced(
            "1",
            "A wall is a bag when random pressures on it add up to at least this share of their mean along every axis.",
            "Between a closed surface (1) and a tube cut at its ends (0 along its axis); chosen.",
        ),
    ] = 0.3
    slide_share: Annotated[
        float,
        sourced(
            "1",
            "Standard deviation of a slide of large parts of a wall, an axis, over how far the wall moved (rms).",
            "Likeliest on 16 effect-free cases of the blind check (tests/benchmarks/gap_noise.py). Simulated walls that are pushed, "
            "or empty towards their neck, slide by 1 to 2 mm.",
        ),
    ] = 0.2
    slide_length_mm: Annotated[
        float,
        sourced(
            "mm",
            "Correlation length of a slide.",
            "Chosen: a large part of a bladder or rectum. Longer than any of `lengths_mm`, so that it is another motion.",
        ),
    ] = 45.0
    drag_per_mm: Annotated[
        float,
        sourced(
            "1/mm",
            "Stiffness that takes a wall along itself, over the tissue's shear modulus.",
            "Numerical: so stiff that tissue moves a wall off its likeliest motion by some hundredths of a millimetre only.",
        ),
    ] = 20.0
    seen_within_mm: Annotated[
        float,
        sourced(
            "mm",
            "A point of the scanned wall tells of the motion when the mesh has its wall this close.",
            "Chosen. Walls of the blind check's pelves are 3 to 6 mm from the prostate.",
        ),
    ] = 3.0
