"""What is said of a stiffness, by how wide its interval is."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.inference.posterior import Posterior, verdict

BOUNDS = np.tile(np.log([5.0, 500.0]), (2, 1))
NAMES = ("prostate_left", "prostate_right")


def posterior(*sd: float, scale: float = 1.0) -> Posterior:
    return Posterior(np.log([20.0, 60.0]), np.diag(np.square(sd)), 1.0 / np.array(sd), scale, BOUNDS)


def test_a_narrow_interval_is_said_in_per_cent_a_wide_one_as_a_factor() -> None:
    said = verdict(NAMES, posterior(0.05, 0.3)).split("; ")
    assert said[0] == "prostate left: known within 10 % (95 %)"
    assert said[1] == "prostate right: known within a factor of 1.8 (95 %)"
    assert said[2:4] == ["mu1 and mu2 cannot be told apart by one pair", "only G = 2 (mu1 + mu2) is identified"]
    assert said[4] == "all stiffness is relative to the assumed stiffness of the surrounding tissue"


def test_one_region_may_be_told_and_the_other_not() -> None:
    said = verdict(NAMES, posterior(0.3, 1.3))
    assert not said.startswith("nothing can be identified")
    assert "prostate right: not identifiable, this pair says no more than the allowed range did" in said


@pytest.mark.parametrize(
    ("scale", "untold", "why"),
    [
        (1.0, "", "too small against the contours' error"),
        (1.99, "", "too small against the contours' error"),
        (2.0, "", "by far more than the contours' error"),
        (1.0, "contours mislead", "nothing can be identified: contours mislead"),
    ],
)
def test_where_nothing_is_told_it_is_said_why(scale: float, untold: str, why: str) -> None:
    said = verdict(NAMES, posterior(1.3, 1.3, scale=scale), untold=untold)
    assert said.startswith("nothing can be identified: ") and why in said.split("; ")[0]


def test_another_law_and_shares_are_said() -> None:
    assert "G is the initial shear modulus of the law ogden" in verdict(NAMES, posterior(0.1, 0.1), other_law="ogden")
    narrow = Posterior(
        np.array([0.3, 0.6]), np.diag([0.01, 0.01]) ** 2, np.full(2, 100.0), 1.0, np.tile([0.0, 1.0], (2, 1))
    )
    said = verdict(NAMES, posterior(0.1, 0.1), narrow)
    assert "prostate left: mu1 is 28 to 32 % of mu1 + mu2 (95 %)" in said
    wide = Posterior(np.array([0.5, 0.5]), np.diag([0.07, 0.07]), np.full(2, 3.0), 1.0, np.tile([0.0, 1.0], (2, 1)))
    assert "prostate left: mu1 and mu2 cannot be told apart, mu1 may be" in verdict(NAMES, posterior(0.1, 0.1), wide)
