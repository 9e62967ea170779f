"""Colours that mean the same to everybody."""

from __future__ import annotations

import numpy as np

from palpate.ui.pictures.colours import STIFFNESS_SCALE


def test_stiffer_is_lighter_so_that_grey_print_reads_the_same() -> None:
    steps = np.geomspace(STIFFNESS_SCALE.low, STIFFNESS_SCALE.high, 50)
    grey = np.array([STIFFNESS_SCALE.rgb(v) for v in steps]) @ [0.299, 0.587, 0.114]
    assert (np.diff(grey) > 0).all()


def test_a_stiffness_beyond_an_end_has_the_colour_of_that_end() -> None:
    assert STIFFNESS_SCALE.rgb(1.0) == STIFFNESS_SCALE.rgb(5.0) and STIFFNESS_SCALE.rgb(900.0) == STIFFNESS_SCALE.rgb(
        500.0
    )
