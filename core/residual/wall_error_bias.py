"""Bias of ln G by errors of the walls' motion, to first order.

A fit takes the walls' motion as known. Its errors move the predicted organ, the less the stiffer the organ is, so that
a sum of squares with fixed weights W has its minimum at too stiff an organ (errors in variables; Fuller 1987, chapter
1). The expected sum holds tr(W S) beside the effect of the stiffness, with S the covariance of the data at that
stiffness. Without that term (corrected score; Nakamura 1990) the minimum moves by C g / 2, with g the derivative of
tr(W S) in ln G and C the covariance of ln G.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.observe.contour_noise import Weighting
from palpate.core.residual.joint_states import JointLinearisation, JointModel
from palpate.core.residual.linearised_model import NOTHING, PLAIN
from palpate.core.residual.noise_covariance import NoiseParts, NoiseSizes
from palpate.core.residual.noise_model_options import NoiseModelOptions

# Step of ln G in the derivative.
_STEP = 0.1


def noise_slope(
    model: JointModel, weighting: Weighting, sizes: NoiseSizes, at: JointLinearisation, options: NoiseModelOptions
) -> FloatArray:
    """Derivative (t,) of tr(W S) in ln G at a plain model's linearisation; 0 where a neighbour has no equilibrium."""

    def noise(theta: FloatArray) -> float:
        linearisation = model.solve(PLAIN, theta, NOTHING, at)
        if linearisation is None:
            return float("nan")
        S = NoiseParts.of(linearisation.each, model.data_vectors, options).covariance(sizes, np.zeros((model.n, 1)))
        return float(np.trace(weighting.whiten(weighting.whiten(S).T)))

    return np.nan_to_num(central_slope(noise, at.theta))


def central_slope(value: Callable[[FloatArray], float], theta: FloatArray) -> FloatArray:
    """Central differences (t,) of a function of ln G (t,)."""
    steps = _STEP * np.eye(len(theta))
    return np.array([(value(theta + h) - value(theta - h)) / (2.0 * _STEP) for h in steps])


def wall_bias(slope: FloatArray, covariance: FloatArray, least: float) -> FloatArray:
    """Bias (t,) of a fitted ln G with this covariance (t, t), positive for too stiff.

    slope (t,) : see `noise_slope`.
    """
    precision = np.linalg.inv(covariance) + least * np.eye(len(slope))
    return np.asarray(-0.5 * np.linalg.solve(precision, slope), dtype=np.float64)
