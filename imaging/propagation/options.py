"""Numbers of contour propagation, each with unit and source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from palpate.core.sourced_number import sourced
from palpate.imaging.matching.local_matching import Level


@dataclass(frozen=True, kw_only=True)
class PropagationOptions:
    """first : levels of matching with what hollow organs hold left out in the scan that was drawn. second : in both scans."""

    first: tuple[Level, ...] = (Level(4.0, 16.0, 3, rounds=2), Level(2.0, 8.0, 3, rounds=2), Level(0.9, 5.0, rounds=2))
    second: tuple[Level, ...] = (
        Level(2.0, 8.0, 3, rounds=2),
        Level(0.9, 5.0, 3, rounds=2),
        Level(0.9, 4.0, 3, rounds=3),
    )
    wall_mm: Annotated[
        float,
        sourced(
            "mm",
            "Rim within the contour of a hollow organ that is compared; what lies deeper is contents.",
            "Chosen: thinner than any wall, whose thickness changes as the organ fills. With 3 mm the rectum was off by 1.3 times as much.",
        ),
    ] = 1.0
    window_mm: Annotated[
        float,
        sourced(
            "mm",
            "Standard deviation of the windows whose motion is the data.",
            "As in matching, smaller: tissue at a wall strains most.",
        ),
    ] = 2.5
    apart_mm: Annotated[
        float, sourced("mm", "Distance of these windows.", "Twice their standard deviation: they hardly overlap.")
    ] = 5.0
    reach_mm: Annotated[
        float,
        sourced(
            "mm",
            "How far from the organs' surfaces windows count.",
            "Chosen: a little more than a local strain reaches.",
        ),
    ] = 12.0
    strain: Annotated[
        float,
        sourced(
            "1",
            "Standard deviation of a component of the displacement's gradient in the tissue, a priori.",
            "Pairs that tell a stiffness well strain the organ by about 0.15 (`core/identify/pair/rough_contours.py`), as the largest "
            "principal strain; that of a random gradient is 1.66 times its components, rms.",
        ),
    ] = 0.09
    strain_length_mm: Annotated[
        float,
        sourced(
            "mm",
            "Length over which that strain goes together (Matern 3/2).",
            "Chosen: a quarter of a prostate's width.",
        ),
    ] = 10.0
    far_length_mm: Annotated[
        float, sourced("mm", "Length over which all tissue moves together.", "Chosen: an organ's size.")
    ] = 50.0
    far_sizes_mm: Annotated[
        tuple[float, ...],
        sourced(
            "mm",
            "Sizes of that motion that are told apart.",
            "Chosen from below matching's error to a full bladder's; the data choose.",
        ),
    ] = (0.3, 0.6, 1.2, 2.4, 4.8)
    wall_length_mm: Annotated[
        float,
        sourced(
            "mm",
            "Length over which a hollow organ's wall moves alike along its normal.",
            "Chosen: about the organ's width.",
        ),
    ] = 30.0
    wall_fade_mm: Annotated[
        float,
        sourced(
            "mm",
            "Distance from the wall over which its motion fades, e-fold.",
            "Chosen: the radius of a rectum, as around a tube that shrinks.",
        ),
    ] = 12.0
    wall_sizes_mm: Annotated[
        tuple[float, ...],
        sourced(
            "mm",
            "Sizes of a wall's motion that are told apart, each organ's own.",
            "Chosen from none to a full rectum's; the data choose.",
        ),
    ] = (0.0, 0.6, 1.2, 2.4, 4.8, 9.6)
    most_windows: Annotated[
        int,
        sourced(
            "1",
            "Most components of windows' motions that are used.",
            "Chosen for time: a matrix of this size is factorised.",
        ),
    ] = 2500
    asked_windows: Annotated[int, sourced("1", "Components among which the sizes are chosen.", "Chosen for time.")] = (
        700
    )
    grid_mm: Annotated[
        float, sourced("mm", "Lattice on which the motion is given.", "Chosen: a third of `strain_length_mm`.")
    ] = 3.0
    least_alike: Annotated[
        float,
        sourced(
            "1",
            "Correlation of both images about the organs, after matching, below which nothing is carried over.",
            "Chosen: scans of one patient have 0.9 and more, those of two patients about 0.5.",
        ),
    ] = 0.7
