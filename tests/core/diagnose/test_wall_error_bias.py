"""What noisy walls pull the stiffness by: an estimate against the mean of many draws."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.residual.wall_error_bias import central_slope, wall_bias

THETA, WALL_SD, SD = 0.5, 0.35, 0.1


def test_walls_that_are_read_wrongly_make_an_organ_look_stiff_by_what_is_said() -> None:
    """An organ that moves by exp(-ln G) of how far its wall does, 40 walls of 2 mm, each read 0.35 mm wrongly; least squares for ln G."""
    rng = np.random.default_rng(8)
    wall = np.full(40, 2.0)
    seen = wall + WALL_SD * rng.standard_normal((20_000, 40))
    organ = np.exp(-THETA) * wall + SD * rng.standard_normal((20_000, 40))
    fitted = -np.log((organ * seen).sum(axis=1) / (seen**2).sum(axis=1))
    said = []
    for theta in fitted[:50]:
        weight = 1.0 / (SD**2 + np.exp(-2.0 * theta) * WALL_SD**2)
        slope = central_slope(
            lambda at, w=weight: w * 40 * (SD**2 + np.exp(-2.0 * at[0]) * WALL_SD**2), np.array([theta])
        )
        J = np.exp(-theta) * wall
        said.append(wall_bias(slope, np.array([[1.0 / (weight * J @ J)]]), 1.0)[0])
    bias = float(fitted.mean() - THETA)
    assert bias > 20.0 * fitted.std() / np.sqrt(len(fitted))
    assert np.mean(said) == pytest.approx(bias, rel=0.05)


def test_where_data_tell_next_to_nothing_little_is_taken_off() -> None:
    assert wall_bias(np.array([-1.0]), np.array([[1e4]]), 1.0)[0] < 0.51
    assert wall_bias(np.array([-1.0]), np.array([[0.01]]), 1.0)[0] == pytest.approx(0.005, rel=0.02)
