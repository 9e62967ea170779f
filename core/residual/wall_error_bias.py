"""How far walls that are read wrongly pull ln G, to first order, so that it can be taken off what is reported.

A fit takes the walls' motion for known. What is wrong with it moves the predicted organ, the less the stiffer the organ is, so that a sum
of squares with fixed weights W has its minimum at too stiff an organ (errors in variables; Fuller 1987, chapter 1). Its expectation has
tr(W S) beside what the stiffness does, S the covariance of the data at that stiffness; without that term (corrected score; Nakamura 1990)
the minimum moves by C g / 2, g the derivative of tr(W S) in ln G and C the covariance of ln G.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.observe.contour_noise import Weighting
from palpate.core.residual.joint_states import JointLinearisation, States
from palpate.core.residual.linearised_model import NOTHING, PLAIN
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.noise_model_options import NoiseModelOptions

# Step of ln G in the derivative.
_STEP = 0.1


def noise_slope(
    bench: States, weighting: Weighting, sizes: NoiseSizes, at: JointLinearisation, options: NoiseModelOptions
) -> FloatArray:
    """(t,) derivative in ln G of tr(W S), at a plain model's points; 0 where a neighbour has no equilibrium."""

    def noise(theta: FloatArray) -> float:
        point = bench.solve(PLAIN, theta, NOTHING, at)
        if point is None:
            return float("nan")
        S = NoiseParts.of(point.each, bench.sights, options).covariance(sizes, np.zeros((bench.n, 1)))
        return float(np.trace(weighting.whiten(weighting.whiten(S).T)))

    return np.nan_to_num(central_slope(noise, at.theta))


def central_slope(value: Callable[[FloatArray], float], theta: FloatArray) -> FloatArray:
    """(t,) central differences of a function of ln G (t,)."""
    steps = _STEP * np.eye(len(theta))
    return np.array([(value(theta + h) - value(theta - h)) / (2.0 * _STEP) for h in steps])


def wall_bias(slope: FloatArray, covariance: FloatArray, least: float) -> FloatArray:
    """(t,) by how much a fitted ln G of this covariance (t, t) is too high; slope (t,) : see `noise_slope`.

    least : precision of ln G below which a first order means nothing: where data tell less, no more is taken off.
    """
    precision = np.linalg.inv(covariance) + least * np.eye(len(slope))
    return np.asarray(-0.5 * np.linalg.solve(precision, slope), dtype=np.float64)
