"""Options of an identification."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from palpate.core.errors import InputError
from palpate.core.fem.elements import ELEMENTS

# The organ's law where nobody chooses another (`Facts.organ_law`).
ORGAN_LAW = "mooney-rivlin"
METHODS = ("swarm", "gauss-newton")
BOUNDARIES = ("coupled", "contact-force")


@dataclass(frozen=True)
class IdentifyOptions:
    """method, boundary : see METHODS, BOUNDARIES. element : of the forward model.

    particles, iterations : of the swarm (the paper's M = 40; it stops earlier when it has collapsed). seed : of the swarm.
    workers : processes that evaluate particles; the answer does not depend on it. starts : of Gauss-Newton. reduced : let the swarm use the
    reduced model where its own error estimate allows. stiffness_map : also map the stiffness within the organ (boundary "coupled" only).
    uneven : do not take regions for uniform: what a focus within one does at the surface counts as an error.
    split_mu : look for mu1 and mu2 of every region apart, instead of mu1 = mu2; of Mooney-Rivlin only.
    law : name of the organ's strain energy, in `core.laws.LAWS`; G is found of any.
    image : use, beside the contours, the motion that the two CTs' images tell, where the case has both; None leaves it to the case
    (`case.matched.wants_image`).
    Raises InputError for values out of range.
    """

    method: Literal["swarm", "gauss-newton"] = "swarm"
    boundary: Literal["coupled", "contact-force"] = "coupled"
    element: str = "p2p1"
    particles: int = 40
    iterations: int = 50
    seed: int = 1
    workers: int = 1
    starts: int = 3
    reduced: bool = True
    stiffness_map: bool = True
    split_mu: bool = False
    uneven: bool = False
    image: bool | None = None
    law: str = ORGAN_LAW

    def __post_init__(self) -> None:
        for name, value, allowed in (
            ("method", self.method, METHODS),
            ("boundary", self.boundary, BOUNDARIES),
            ("element", self.element, tuple(ELEMENTS)),
        ):
            if value not in allowed:
                raise InputError(f"{name} '{value}' is unknown; choose one of {', '.join(allowed)}")
        for name, number, low, high in (
            ("particles", self.particles, 4, 1000),
            ("iterations", self.iterations, 1, 10000),
            ("workers", self.workers, 1, 256),
            ("starts", self.starts, 1, 64),
        ):
            if not low <= number <= high:
                raise InputError(f"{name} = {number} is out of range; give {low} to {high}")
        if self.law != ORGAN_LAW:
            self._check_law()

    @property
    def other_law(self) -> str:
        """The law's name where it is not Mooney-Rivlin, else "": mu1 and mu2 are constants of that one alone."""
        return "" if self.law == ORGAN_LAW else self.law

    def _check_law(self) -> None:
        from palpate.core.laws import LAWS  # here: the kernels of all laws take long to load

        if self.law not in LAWS:
            raise InputError(f"law '{self.law}' is unknown; choose one of {', '.join(sorted(LAWS))}")
        LAWS[self.law].of_moduli(1.0, 1.0)
        if self.split_mu:
            raise InputError(
                f"mu1 and mu2 are constants of {ORGAN_LAW}, not of {self.law}; leave split_mu or the law out"
            )
