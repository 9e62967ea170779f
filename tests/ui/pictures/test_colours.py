"""Colours that mean the same to everybody."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.ui.pictures.colours import StiffnessScale


@pytest.mark.parametrize("values", [[15.0, 42.0], [30.0, 148.0], [6.0, 400.0]])
def test_stiffer_is_lighter_so_that_grey_print_reads_the_same(values: list[float]) -> None:
    scale = StiffnessScale.of(values)
    steps = np.linspace(scale.low + 1e-6, scale.high, 50)
    grey = np.array([scale.rgb(v) for v in steps]) @ [0.299, 0.587, 0.114]
    assert (np.diff(grey) > 0).all()
    assert scale.low < min(values) and max(values) < scale.high


def test_scale_is_logarithmic_only_where_a_linear_one_hides_the_soft() -> None:
    assert not StiffnessScale.of([15.0, 42.0]).log
    assert StiffnessScale.of([6.0, 400.0]).log


def test_scale_without_any_stiffness_stands() -> None:
    assert StiffnessScale.of([]).high > 0.0
    assert StiffnessScale.of([float("nan")]).high > 0.0
