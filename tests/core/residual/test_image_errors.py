"""Errors of the model that the images show, on arrays."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from palpate.core.residual.image_errors import ImageErrorSizes, _local, _squared
from palpate.core.residual.noise_model_options import NoiseModelOptions

RNG = np.random.default_rng(4)
PLACES = RNG.uniform(-15.0, 15.0, (7, 3))
# Two rows of contours look at the first four places, three of matched motion at the last three, one of bones at none.
ROWS = np.zeros((6, 7, 3))
ROWS[:2, :4], ROWS[2:5, 4:] = RNG.standard_normal((2, 4, 3)), RNG.standard_normal((3, 3, 3))


def _state(n_motion: int = 3) -> tuple[Any, Any]:
    rows = SimpleNamespace(places=PLACES[4:])
    observation = SimpleNamespace(every_place=PLACES, motion=SimpleNamespace(rows=rows))
    at = SimpleNamespace(scene=SimpleNamespace(observation=observation), equilibrium=SimpleNamespace(u=None))
    data = SimpleNamespace(n=6, n_motion=n_motion, motion=slice(2, 5), per_place=lambda scene, u: ROWS)
    return at, data


@pytest.mark.parametrize("length", [4.0, 12.0])
def test_a_displacement_that_the_model_lacks_is_a_gaussian_process_of_each_axis(length: float) -> None:
    kernel = np.exp(-0.5 * (cdist(PLACES, PLACES) / length) ** 2)
    by_hand = sum(ROWS[:, :, axis] @ kernel @ ROWS[:, :, axis].T for axis in range(3))
    np.testing.assert_allclose(_local(*_state(), length), by_hand, atol=1e-12)


def test_a_state_without_matched_motion_has_none() -> None:
    assert not _local(*_state(0), 8.0).any()
    assert not _squared(np.zeros((6, 0)), cast(Any, SimpleNamespace(n=6))).any()
    responses = RNG.standard_normal((6, 2))
    np.testing.assert_allclose(_squared(responses, cast(Any, None)), responses @ responses.T)


def test_the_local_error_s_variance_is_shared_evenly_before_the_data_speak() -> None:
    numbers = NoiseModelOptions()
    sizes = ImageErrorSizes.of(numbers)
    assert np.sum(np.square(sizes.local)) == pytest.approx(numbers.local_mm**2)
    assert len(set(sizes.local)) == 1 and sizes.edge == numbers.edge_mm
    other = sizes.with_variances(np.arange(1.0, len(sizes.local) + 2.0))
    np.testing.assert_allclose(other.variances, np.arange(1.0, len(sizes.local) + 2.0))
