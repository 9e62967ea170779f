"""What is said where two searches end at different stiffnesses, and where the misfit is too large."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.core.files.json_types import plain
from palpate.core.identify.notes import agreement, too_large

NAMES = ("prostate_left", "prostate_right")


def found(swarm: tuple[float, float] | None, sd: tuple[float, float]) -> Any:
    """An identification whose Gauss-Newton ended at 20 and 60 kPa. swarm : kPa. sd : of each ln G."""
    optimum = np.log([20.0, 60.0])
    theta = None if swarm is None else np.log(swarm)
    return SimpleNamespace(
        scene=SimpleNamespace(parameters=SimpleNamespace(shear_moduli=np.exp, stiffness=slice(0, 2))),
        theta=optimum,
        starts_agree=True,
        swarm=None if theta is None else SimpleNamespace(theta=theta),
        agreement=0.0 if theta is None else float(np.abs(theta - optimum).max()),
        stiffness=SimpleNamespace(sd=np.array(sd)),
    )


@pytest.mark.parametrize(
    "right, same, harmless", [(60.0 * np.exp(0.05), True, True), (60.0 * np.exp(0.08), False, True), (90.0, False, False)]
)  # fmt: skip
def test_searches_are_compared_by_each_regions_own_interval(right: float, same: bool, harmless: bool) -> None:
    facts = plain(agreement(found((20.0, right), (0.01, 0.25)), NAMES))
    assert (facts["same_optimum"], facts["harmless"]) == (same, harmless)
    assert facts["difference_sd"]["prostate_left"] == pytest.approx(0.0)
    assert facts["difference_sd"]["prostate_right"] == pytest.approx(np.log(right / 60.0) / 0.25)
    assert ("harmless" in facts["in_words"]) == (harmless and not same)
    assert ("more than one low place" in facts["in_words"]) == (not harmless)


def test_the_sentence_gives_both_values_of_every_region() -> None:
    words = agreement(found((21.0, 90.0), (0.3, 0.25)), NAMES).in_words
    assert "prostate left 21 and 20 kPa, 0.16 sd" in words and "prostate right 90 and 60 kPa, 1.6 sd" in words


def test_one_search_alone_has_nothing_to_differ_from() -> None:
    facts = plain(agreement(found(None, (0.3, 0.25)), NAMES))
    assert facts["same_optimum"] and facts["harmless"] and facts["in_words"] == ""


def test_a_large_residual_is_one_figure_beside_the_misfit() -> None:
    words = too_large(1.89)
    assert "1.89 times" in words and " mm" not in words and "misfit" not in words


def test_a_residual_that_two_digits_do_not_show_is_no_note() -> None:
    assert too_large(1.0) == "" and too_large(1.004) == "" and "1.01 times" in too_large(1.01)
