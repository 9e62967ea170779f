"""Placebo effects: as strong and as free as the effect that they are compared with."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.diagnose.detection.placebo import PlaceboSize, placebo_directions
from palpate.core.observe.contour_noise import Weighting

SURFACE, IMAGES, LOADS = 40, 60, 25


@pytest.mark.parametrize("surface", [SURFACE, 0])
@pytest.mark.parametrize("parameters", [1, 6])
def test_a_placebo_changes_all_data_as_much_as_the_effect(surface: int, parameters: int) -> None:
    """Rows of the surface err by 0.4 mm, those of the images are of unit variance; without a drawn organ there are only these."""
    rng = np.random.default_rng(2)
    n = surface + IMAGES
    sd = np.concatenate([np.full(surface, 0.4), np.ones(IMAGES)])
    weighting = Weighting(np.diag(sd**2))
    change = np.concatenate([np.full(surface, 0.5), np.full(IMAGES, 3.0)])
    like = PlaceboSize.of(change, parameters, weighting)
    assert like.size == pytest.approx(np.linalg.norm(change / sd))
    S = placebo_directions(rng.standard_normal((n, LOADS)), like, rng)
    assert S.shape == (n, parameters)
    amplitudes = rng.standard_normal((parameters, 4000))
    assert np.sqrt((((S @ amplitudes) / sd[:, None]) ** 2).sum(axis=0).mean()) == pytest.approx(like.size, rel=0.05)


def test_placebos_gain_from_noise_as_the_effect_would() -> None:
    """Six parameters take six parts of noise; a placebo of one would be beaten by noise alone."""
    rng, n = np.random.default_rng(4), 120
    weighting, loads = Weighting(np.eye(n)), rng.standard_normal((n, LOADS))
    beaten = []
    for _ in range(200):
        r, size = rng.standard_normal(n), 10.0
        like = PlaceboSize(size, 6, weighting)
        effect, *placebos = (taken(placebo_directions(loads, like, rng), r) for _ in range(41))
        beaten.append(np.mean(np.array(placebos) >= effect))
    assert np.mean(np.array(beaten) <= 0.05) < 0.1


def taken(S: np.ndarray, r: np.ndarray) -> float:
    """What directions with unit prior take of a residual's squares."""
    b = S.T @ r
    return float(b @ np.linalg.solve(S.T @ S + np.eye(S.shape[1]), b))
