"""Mean stiffness of a region of the map: its value, its interval with a covariance and without, and what is not told."""

from __future__ import annotations

import numpy as np
import pytest
from map_arrays import map_arrays
from phantoms import CENTRE

from palpate.core.identify.map.region_mean import COVARIANCE, region_mean

LEFT, RIGHT = (CENTRE + np.array([[x, 0.0, 0.0]]) for x in (9.0, -9.0))


def test_at_a_patch_it_is_the_patch_with_its_own_interval() -> None:
    found = region_mean(map_arrays(True), LEFT)
    assert found.G_kpa == pytest.approx(20.0, rel=1e-6) and found.told_share == 1.0
    assert found.interval_kpa == pytest.approx((20.0 * np.exp(-1.96 * 0.2), 20.0 * np.exp(1.96 * 0.2)), rel=1e-6)


def test_patches_that_err_alone_average_out_and_those_that_err_together_do_not() -> None:
    both = np.vstack([LEFT, RIGHT])
    arrays = map_arrays(True)
    arrays.pop(COVARIANCE, None)
    spreads = {}
    for name, covariance in (("none", None), ("alone", 0.04 * np.eye(2)), ("together", np.full((2, 2), 0.04))):
        found = region_mean(arrays if covariance is None else {**arrays, COVARIANCE: covariance}, both)
        assert found.G_kpa == pytest.approx(40.0, rel=1e-6) and found.interval_kpa is not None
        spreads[name] = np.log(found.interval_kpa[1] / 40.0) / 1.96
    # ln(mean) by ln G of each patch: 20/80 and 60/80.
    assert spreads["alone"] == pytest.approx(0.2 * np.hypot(0.25, 0.75), rel=1e-6)
    assert spreads["together"] == pytest.approx(0.2, rel=1e-6)
    assert spreads["none"] == pytest.approx(spreads["together"], rel=1e-6), "without a covariance the widest is taken"


def test_the_interval_holds_the_mean_of_draws() -> None:
    arrays, rng = {**map_arrays(True), COVARIANCE: np.array([[0.04, 0.01], [0.01, 0.04]])}, np.random.default_rng(3)
    draws = np.exp(rng.multivariate_normal(np.log([20.0, 60.0]), arrays[COVARIANCE], 40_000)).mean(axis=1)
    found = region_mean(arrays, np.vstack([LEFT, RIGHT]))
    assert found.interval_kpa is not None
    low, high = found.interval_kpa
    assert float(((low < draws) & (draws < high)).mean()) == pytest.approx(0.95, abs=0.01)


def test_only_what_the_scans_tell_counts() -> None:
    both = np.vstack([LEFT, RIGHT])
    found = region_mean(map_arrays(False), both)
    assert found.G_kpa == pytest.approx(60.0, rel=1e-6) and found.told_share == 0.5
    assert region_mean(map_arrays(False), LEFT).G_kpa is None
    assert region_mean(map_arrays(True), np.zeros((0, 3))).told_share == 0.0
