"""Figures of a sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def rms(values: ArrayLike) -> float:
    """Root of the mean square of all values, whatever their shape, in their unit. At least one value is needed."""
    return float(np.sqrt((np.asarray(values) ** 2).mean()))
