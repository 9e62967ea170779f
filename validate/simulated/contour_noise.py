"""Errors of contours: what is drawn of their law, and one draw of them for two scans."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.labels import BLADDER, BONE, ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume
from palpate.simulate.contour_errors import displaced_labels
from palpate.simulate.source import labels_on
from palpate.validate.simulated.random_fields import Family, Field, Part, random_vectors
from palpate.validate.simulated.two_states import Labels, Points, TwoStates

# What a person contours, by name; the modelled region is not, and bone is found by its HU, wrong by less.
STRUCTURES: Mapping[str, tuple[int, ...]] = {"organ": ORGAN_LABELS, "bladder": (BLADDER,), "rectum": (RECTUM,)}
_ERRING: Mapping[str, tuple[int, ...]] = {**STRUCTURES, "bone": (BONE,)}
STATES = ("rest", "deformed")
# Range of what is drawn for a case: standard deviation and correlation lengths, mm; the walls' and the bones' over the organ's.
SD_MM, LENGTH_MM, WALL_RATIO, BONE_RATIO = (0.2, 0.8), (2.0, 15.0), (0.7, 1.4), (0.3, 1.0)
# Room about a structure within which its field lies, mm; the voxels in which structures are looked for are COARSE_MM.
_ROOM_MM, COARSE_MM = 8.0, 3.0
_FAMILIES: tuple[Family, ...] = ("gaussian", "matern32", "exponential")


@dataclass(frozen=True)
class ContourNoise:
    """Law of the errors along the normal of one contour.

    sd_mm : of the organ's; the walls' is wall_ratio of that, the bones' bone_ratio (0: none). parts : see `random_fields.Part`. axial :
    correlation along z over that in the slice. freedom : of Student's t (None: normal). common : share of the variance that both scans'
    contours have in common.
    """

    sd_mm: float
    parts: tuple[Part, ...]
    wall_ratio: float = 1.0
    bone_ratio: float = 0.0
    axial: float = 1.0
    freedom: float | None = None
    common: float = 0.0

    @classmethod
    def plain(cls, sd_mm: float, length_mm: float) -> ContourNoise:
        """Normal, one squared exponential correlation, nothing in common: what `palpate simulate` draws."""
        return cls(sd_mm, (Part(1.0, "gaussian", length_mm),))

    @classmethod
    def drawn(cls, rng: np.random.Generator, sd_mm: tuple[float, float] = SD_MM) -> ContourNoise:
        """Size, lengths, families, tails and what is common, each drawn: no two cases have the same law."""
        two = rng.random() < 0.5
        shortest, longest = np.log(LENGTH_MM)
        lengths = np.exp(rng.uniform(shortest, longest, 2))
        share = float(rng.uniform(0.3, 0.7)) if two else 1.0
        families = rng.choice(_FAMILIES, 2)
        parts = (Part(share, families[0], float(lengths[0])), Part(1.0 - share, families[1], float(lengths[1])))
        return cls(
            sd_mm=float(np.exp(rng.uniform(*np.log(sd_mm)))),
            parts=parts if two else parts[:1],
            wall_ratio=float(np.exp(rng.uniform(*np.log(WALL_RATIO)))),
            bone_ratio=float(np.exp(rng.uniform(*np.log(BONE_RATIO)))),
            axial=float(rng.uniform(0.4, 1.0)),
            freedom=float(rng.uniform(4.0, 10.0)) if rng.random() < 0.5 else None,
            common=float(rng.uniform(0.0, 0.4)) if rng.random() < 0.5 else 0.0,
        )

    def sd_of(self, structure: str) -> float:
        """Standard deviation of a structure's contour, mm."""
        ratio = {"organ": 1.0, "bone": self.bone_ratio}
        return ratio.get(structure, self.wall_ratio) * self.sd_mm

    def facts(self) -> dict[str, object]:
        """For JSON."""
        return asdict(self) | {"parts": [asdict(part) for part in self.parts]}


@dataclass(frozen=True, eq=False)
class Scan:
    """What one scan shows. labels : points (n, 3) mm -> labels (n,). to_body : points of the scan -> where in the body, mm; None: there."""

    labels: Labels
    to_body: Points | None = None


@dataclass(frozen=True, eq=False)
class ContourErrors:
    """One draw: state and structure -> displacement (n, 3) mm at points (n, 3); a label is asked for beside each point by that much."""

    fields: Mapping[tuple[str, str], Field]

    @classmethod
    def none(cls, states: Sequence[str] = STATES) -> ContourErrors:
        """Perfect contours."""
        return cls({(state, name): np.zeros_like for state in states for name in STRUCTURES})

    @classmethod
    def of(
        cls, noise: ContourNoise, scans: Mapping[str, Scan], grid: Volume, rng: np.random.Generator
    ) -> ContourErrors:
        """Every contour's own, and what the contours of one structure have in common in all scans, which goes along with the tissue.

        scans : by state. grid : a coarse one that holds all that is contoured.
        """
        fields: dict[tuple[str, str], Field] = {}
        seen = [labels_on(scan.labels, grid) for scan in scans.values()]
        for name, members in _ERRING.items():
            if noise.sd_of(name) == 0.0 and name not in STRUCTURES:
                continue
            box = _box(seen, members)
            both = _field(noise, name, box, rng) if noise.common > 0.0 else np.zeros_like
            for state, scan in scans.items():
                fields[state, name] = _together(_field(noise, name, box, rng), both, scan.to_body, noise.common)
        return cls(fields)

    def on(self, state: str, labels: Labels, grid: Volume) -> Volume:
        """Label volume of a scan with these errors."""
        fields = [
            (members, self.fields[state, name]) for name, members in _ERRING.items() if (state, name) in self.fields
        ]
        return displaced_labels(labels, grid, fields)


def _box(seen: Sequence[Volume], members: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Corners (3,) mm of a box that holds a structure in all volumes, with room."""
    points = np.concatenate([v.to_lps(np.argwhere(np.isin(v.array, members)).astype(float)) for v in seen])
    if not len(points):
        return np.zeros(3), np.ones(3)
    return points.min(axis=0) - _ROOM_MM, points.max(axis=0) + _ROOM_MM


def _field(noise: ContourNoise, structure: str, box: tuple[FloatArray, FloatArray], rng: np.random.Generator) -> Field:
    unit, sd = random_vectors(noise.parts, box, rng, noise.axial, noise.freedom), noise.sd_of(structure)
    return lambda points: sd * unit(points)


def _together(own: Field, both: Field, to_body: Points | None, common: float) -> Field:
    if common == 0.0:
        return own
    a, b = np.sqrt(1.0 - common), np.sqrt(common)

    def at(points: FloatArray) -> FloatArray:
        return np.asarray(a * own(points) + b * both(points if to_body is None else to_body(points)))

    return at


def errors_of(noise: ContourNoise, states: TwoStates, rng: np.random.Generator) -> ContourErrors:
    """Errors of the contours of a simulated pair."""
    scans = {"rest": Scan(states.rest), "deformed": Scan(states.deformed, states.to_rest)}
    return ContourErrors.of(noise, scans, states.grid((COARSE_MM,) * 3), rng)
