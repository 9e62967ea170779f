"""Figures of a sample against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.statistics import rms


def test_rms_of_all_values_whatever_their_shape() -> None:
    assert rms([3.0, -4.0, 0.0, 0.0]) == 2.5
    assert rms(np.array([[3.0, -4.0], [0.0, 0.0]])) == 2.5
    angle = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    assert rms(7.0 * np.sin(angle)) == pytest.approx(7.0 / np.sqrt(2.0), rel=1e-12)
