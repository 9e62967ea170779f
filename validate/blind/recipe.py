"""What a case of the blind check is made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from palpate.simulate.walls import BladderSpec, RectumSpec
from palpate.validate.blind.simulator.effects import OWN_SHARE
from palpate.validate.simulated.contour_noise import ContourNoise


@dataclass(frozen=True)
class Recipe:
    """One case: seed, the effects hidden in it (id -> size; none: {}), true G of left and right, kPa.

    noise_mm : standard deviation of one contour. shown_mm : what the two stiffnesses shall leave of each effect alone (rms along the
    normal); its size is then found between SIZES, and that in `effects` not used. least_noise_mm : where even the strongest shows less,
    contours are drawn better in proportion, down to this. build : of the pelvis. rectum, bladder : how far the walls move. edge_mm : of the
    mesh. marks : whether points inside the organ are given. more : how far the walls move in each further deformed state. instead_of : the
    effects drawn first, where no patient's scans could show them.

    noise : law of the contours' errors, whose size is noise_mm. stated_over_true : of that size, what case.json says over what is so; None:
    it says nothing. voxel_mm : of the label volumes. free_edge : nothing holds the edge of the modelled region. marks_mm : error of points
    inside the organ, of one scan and axis. attempt : how many patients were looked at before in vain for one that shows the effects.
    bounds_kpa : of the stiffness, in case.json.
    """

    name: str
    seed: int
    effects: Mapping[str, float] = field(default_factory=dict)
    G: tuple[float, float] = (20.0, 50.0)
    noise_mm: float = 0.35
    shown_mm: float | None = None
    least_noise_mm: float | None = None
    build: int = 0
    rectum: RectumSpec = field(default_factory=lambda: RectumSpec(8.0))
    bladder: BladderSpec = field(default_factory=lambda: BladderSpec(balance=0.8))
    edge_mm: float = 6.5
    marks: bool = False
    more: tuple[tuple[RectumSpec, BladderSpec], ...] = ()
    instead_of: tuple[str, ...] = ()
    noise: ContourNoise = field(default_factory=lambda: ContourNoise.plain(0.35, 6.5))
    stated_over_true: float | None = 1.0
    voxel_mm: tuple[float, float, float] = (1.1, 1.1, 1.8)
    free_edge: bool = False
    marks_mm: float = 0.3
    attempt: int = 0
    bounds_kpa: tuple[float, float] = (5.0, 500.0)

    @property
    def contour_noise(self) -> ContourNoise:
        """Law of the contours' errors, of standard deviation noise_mm."""
        return replace(self.noise, sd_mm=self.noise_mm)

    @property
    def stated_mm(self) -> float | None:
        """Standard deviation that case.json states, mm."""
        return None if self.stated_over_true is None else round(self.stated_over_true * self.noise_mm, 3)

    @property
    def best_noise_mm(self) -> float:
        """Standard deviation of one contour, mm, of the best contours that the recipe may have."""
        return self.noise_mm if self.least_noise_mm is None else min(self.least_noise_mm, self.noise_mm)

    def random(self, what: int) -> np.random.Generator:
        """Random numbers for one purpose."""
        return np.random.default_rng([self.seed, what])

    def shares(self) -> list[dict[str, float]]:
        """Of each further state: which share of their size the effects have there that are not the same in all."""
        rng = self.random(6)
        return [{name: float(rng.uniform()) for name in self.effects if name in OWN_SHARE} for _ in self.more]
