"""Figures of stated surface errors beside true ones: drawn errors of a known size are judged as such."""

from __future__ import annotations

import numpy as np
import pytest
from surface_error_model import JudgedSurface, as_it_is, fitted, held_out

from palpate.core.arrays import FloatArray
from palpate.segmentation.error_estimate import Clues, ErrorModel
from palpate.segmentation.methods.star_surface import star
from palpate.segmentation.surface_error import expected_dice

# Errors of 1 mm where runs spread by 0.5 mm, of 4 mm where they spread by 3.5 mm.
MODEL = ErrorModel(weights=(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def surface(scan: str, whole_mm: float, seed: int, steeper: bool = False) -> JudgedSurface:
    """A ball of 20 mm whose errors are normal with the standard deviation that MODEL says; its halves differ if steeper."""
    shell = star(np.zeros(3), np.full(642, 20.0))
    spread = np.full(642, whole_mm) + 2.0 * steeper * (shell.points[:, 2] > 0.0)
    no: FloatArray = np.zeros(642)
    clues = Clues(spread, np.full(642, whole_mm), no, no, no + 100.0, no, no)
    sd = MODEL.sd_mm(clues)
    errors = np.random.default_rng(seed).normal(0.0, sd)
    chosen = np.arange(642)
    return JudgedSurface(scan, "prostate", "auto", clues, errors, expected_dice(shell, chosen, sd), shell, chosen)


def test_errors_that_are_true_are_said_to_be() -> None:
    ours = [surface("a", mm, seed, steeper=True) for seed, mm in enumerate((0.5, 1.0, 2.0, 3.5))]
    told = as_it_is(ours, "prostate", MODEL)
    assert told["surfaces"] == 4 and told["said_over_true"][1] == pytest.approx(1.0, abs=0.05)
    assert told["within"] == pytest.approx(0.95, abs=0.02)
    assert told["rank"] == 1.0 and told["place_rank"] > 0.15


def test_errors_said_to_be_half_as_large_are_judged_so() -> None:
    ours = [surface("a", mm, seed) for seed, mm in enumerate((1.0, 2.0, 3.5))]
    half = ErrorModel(weights=(float(np.log(0.5)), *MODEL.weights[1:]))
    told = as_it_is(ours, "prostate", half)
    assert told["said_over_true"][1] == pytest.approx(0.5, abs=0.03)
    assert told["within"] == pytest.approx(0.67, abs=0.04)
    assert told["place_rank"] == 0.0  # one error all over the surface ranks no place


def test_a_fit_finds_the_size_on_scans_that_it_has_not_seen() -> None:
    ours = [
        surface(scan, mm, 10 * seed + k)
        for k, scan in enumerate("abc")
        for seed, mm in enumerate((0.5, 1.0, 2.0, 3.0, 4.0))
    ]
    told = held_out(ours, "prostate")
    assert told["surfaces"] == 15 and 0.75 < told["said_over_true"][1] < 1.35
    low, high = (float(np.median(fitted(ours).sd_mm(surface("d", mm, 1).clues))) for mm in (0.5, 4.0))
    assert high > 1.6 * low
