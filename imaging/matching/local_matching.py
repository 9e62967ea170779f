"""Local matching of two scans: a displacement and its precision at each control point.

Every point has a Gaussian window in which the motion is the predicted one and a small constant shift. Shift, brightness
and contrast of the window minimise the squared difference of the two scans (Lucas and Kanade 1981; in mechanics: digital
volume correlation), in coarse windows on smoothed scans first. What is left of the difference is the noise.

Tissue about an organ strains by tenths, so that the motion in a window of 5 mm is not constant: its shift is a mean
weighed by texture, and neighbouring windows err alike. The windows therefore only find the smooth motion that both scans
are compared under. The data are the steps from there that smaller windows ask for, which hardly overlap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.imaging.matching.scan_pair import Motion, ScanPair
from palpate.imaging.matching.scores import Compared
from palpate.imaging.matching.window_errors import (
    less_sure,
    one_step,
    precision_of_step,
    texture_and_precision,
    variance_left,
)
from palpate.imaging.matching.window_fits import NormalEquations, equations_under, shifts, smooth_field
from palpate.imaging.matching.window_sums import Windows
from palpate.imaging.volume import Volume

# Number of the matching's form: motion that another one found is out of date.
MATCHING = 4


@dataclass(frozen=True)
class Level:
    """smoothing_mm : standard deviation of the filter that both scans go through. window_mm : of the windows. iterations :
    Gauss-Newton steps. rounds : how often the windows' shifts become part of the motion that they are sought about."""

    smoothing_mm: float
    window_mm: float
    iterations: int = 4
    rounds: int = 1


@dataclass(frozen=True, kw_only=True)
class MatchOptions:
    """levels : from coarse to fine, which find the smooth motion. window_mm : standard deviation of the windows whose shifts
    from it are the data; what noise leaves in a smaller one averages out over as many more of them, what uneven motion
    leaves in a larger one does not (in the modes of the sample pair errors are 6.9 times what is stated with 5 mm, 1.8 with
    3, 1.5 with 2). spacing_mm : about the distance of these control points. full : the least share of a window that must be
    usable."""

    levels: tuple[Level, ...] = (Level(2.0, 8.0, 3), Level(0.9, 5.0, rounds=2))
    window_mm: float = 3.0
    spacing_mm: float = 7.0
    full: float = 0.3


@dataclass(frozen=True, eq=False)
class LocalMatches:
    """points : (n, 3) mm in the first scan, each where its window's texture lies. displacement : (n, 3) mm to where they lie in the second.

    precision : (n, 3, 3) 1/mm2 of each displacement; a direction without texture has none. cautious : (n, 3, 3) 1/mm2, the same less
    what noise may feign by chance, by which points are rejected. shift : (n, 3) mm from the
    predicted to the matched motion. left_hu : (n,) standard deviation of the difference that is left in the window.
    correlation_mm : distance over which errors of neighbouring points go along, as exp(-(d / correlation_mm)^2). beyond :
    smooth motion (mi, mj, mk, 3) mm beyond the predicted one, from which the points' own shifts are counted. windows :
    (n, 3), their indices in the lattice of `compared`, the scans under that motion.
    """

    points: FloatArray
    displacement: FloatArray
    precision: FloatArray
    cautious: FloatArray
    shift: FloatArray
    left_hu: FloatArray
    correlation_mm: float
    beyond: Volume
    windows: IntArray
    compared: Compared


def match(
    first: Volume,
    second: Volume,
    usable: tuple[BoolArray, BoolArray],
    predicted: Motion,
    options: MatchOptions | None = None,
    bright: FloatArray | None = None,
) -> LocalMatches:
    """The motion from the first scan to the second.

    first, second : HU, axes of the first along LPS. usable : masks on the grids of both of what has a counterpart in
    the other (no urine, gas, stool, bone, nothing outside the body). predicted : displacement (n, 3) mm at points
    (n, 3) mm, from which matching starts. bright : (b, 3) mm, spots whose windows are control points in any case.
    """
    options = options or MatchOptions()
    pair, beyond, uneven = _smooth_motion(first, second, usable, predicted, options)
    small = replace(pair, windows=Windows.of(pair.grid, options.window_mm))
    nodes = small.windows.nodes
    at = equations_under(small, *small.moved(beyond.at(nodes.reshape(-1, 3)).reshape(nodes.shape)))
    keep = _control_points(small, at, options, bright)
    variance = variance_left(small, at)
    texture, cautious, score = (field[keep] for field in texture_and_precision(small, at, variance))
    centre = centre_of_texture(small, at, keep)
    shift = beyond.at(centre) + one_step(texture, at.right[keep], cautious)
    precision = precision_of_step(texture, score, cautious)
    cautious = less_sure(cautious, uneven.at(centre))
    compared = Compared(small, at, lambda points: predicted(points) + beyond.at(points))
    return LocalMatches(
        centre, predicted(centre) + shift, precision, cautious, shift, np.sqrt(variance[keep]), 2.0 * options.window_mm, beyond,
        np.argwhere(keep), compared,
    )  # fmt: skip


def _smooth_motion(
    first: Volume, second: Volume, usable: tuple[BoolArray, BoolArray], predicted: Motion, options: MatchOptions
) -> tuple[ScanPair, Volume, Volume]:
    """The finest level's pair, the smooth motion (mi, mj, mk, 3) mm beyond the predicted one, and how far its windows' last
    shifts (mi, mj, mk, 3) mm are from their neighbours'."""
    beyond: Volume | None = None
    for level in options.levels:
        pair = ScanPair.of(first, second, usable, predicted, level.smoothing_mm, level.window_mm)
        nodes = pair.windows.nodes
        field = np.zeros_like(nodes) if beyond is None else beyond.at(nodes.reshape(-1, 3)).reshape(nodes.shape)
        for _ in range(level.rounds):
            shift, at = shifts(pair, field, level.iterations)
            smooth = smooth_field(pair, shift, at.A)
            field = field + smooth
        beyond = pair.windows.lattice.with_array(field)
    assert beyond is not None
    return pair, beyond, pair.windows.lattice.with_array(shift - smooth)


def centre_of_texture(pair: ScanPair, at: NormalEquations, keep: BoolArray) -> FloatArray:
    """Where in its window (n, 3) mm the texture lies that a shift was found by: there it holds."""
    texture = at.weight * sum(f * f for f in at.gradient)
    total = np.maximum(pair.windows.sum(texture)[keep], 1e-9)
    axes = [np.arange(n, dtype=np.float32) for n in pair.first.shape]
    index = [np.reshape(x, [-1 if b == a else 1 for b in range(3)]) for a, x in enumerate(axes)]
    mean = [pair.windows.sum(texture * (i - i.mean()))[keep] / total + i.mean() for i in index]
    return pair.grid.to_lps(np.stack(mean, axis=-1).astype(np.float64))


def _control_points(pair: ScanPair, at: NormalEquations, options: MatchOptions, bright: FloatArray | None) -> BoolArray:
    """Windows that are full enough and about a usable voxel: every few nodes, and those nearest to bright spots."""
    lattice = pair.windows.lattice
    chosen = np.zeros(lattice.array.shape, dtype=bool)
    every = np.maximum(np.rint(options.spacing_mm / lattice.spacing).astype(int), 1)
    chosen[tuple(slice(int(e) // 2, None, int(e)) for e in every)] = True
    if bright is not None and len(bright):
        near = np.rint(lattice.to_index(bright)).astype(int)
        chosen[tuple(np.clip(near, 0, np.array(chosen.shape) - 1).T)] = True
    voxel = np.rint(pair.grid.to_index(pair.windows.nodes.reshape(-1, 3))).astype(int)
    voxel = np.clip(voxel, 0, np.array(pair.first.shape) - 1)
    usable = at.weight[tuple(voxel.T)].reshape(chosen.shape) > 0.5
    return np.asarray(chosen & usable & (pair.windows.sum(at.weight) > options.full))
