"""The stiffness with an effect on a grid: the normal distribution about the optimum takes the response to be linear.

The organ's response fades with its stiffness, with an effect as without one, so that softer and stiffer organs than the optimum are not
excluded alike. The effect's parameters are refitted to first order at every point.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.inference.grid_posterior import GridPosterior
from palpate.core.residual.exploration import Whitened, explored
from palpate.core.residual.joint_states import JointLinearisation
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.worker.progress import Progress, silent

# A parameter as near to a bound as this, in prior standard deviations, is held there.
_AT_BOUND = 1e-6


def with_posterior(fit: PlainFit, refit: Refit, progress: Progress = silent) -> Refit:
    """The refit with the posterior of its ln G (t,) on a grid; as it is where there is no grid (`exploration.explored`): its own normal is
    cut at the bounds where it is used.
    """
    hypothesis, effect = refit.hypothesis, refit.hypothesis.effect
    assert effect is not None
    model = fit.model.corrected(refit.correction)
    free, phi = _free(refit), refit.phi

    def seen(at: JointLinearisation, in_phi: FloatArray) -> Whitened:
        """With what the effect's free parameters can take up, taken out."""
        scaled = fit.weighting.whiten(in_phi) * effect.scales
        r = np.concatenate([fit.weighting.whiten(at.residual), phi / effect.scales])
        J = np.vstack([fit.weighting.whiten(at.in_theta), np.zeros((len(phi), len(at.theta)))])
        Q = np.linalg.qr(np.vstack([scaled, np.eye(len(phi))])[:, free])[0]
        return Whitened(at, r - Q @ (Q.T @ r), J - Q @ (Q.T @ J))

    def solve(theta: FloatArray, near: JointLinearisation) -> Whitened | None:
        there = model.solve(hypothesis, theta, phi, near)
        return None if there is None else seen(there, model.directions(hypothesis, there))

    words = effect.id.replace("_", " ")
    optimum = seen(refit.linearisation, refit.in_phi)
    found = explored(solve, optimum, fit.bounds, progress, words)
    return replace(refit, posterior=found) if isinstance(found, GridPosterior) else refit


def _free(refit: Refit) -> BoolArray:
    """Which parameters (k,) of the effect are not held at a bound."""
    assert refit.hypothesis.effect is not None
    low, high = refit.hypothesis.effect.bounds.T
    near = _AT_BOUND * refit.hypothesis.effect.scales
    return np.asarray((refit.phi > low + near) & (refit.phi < high - near))
