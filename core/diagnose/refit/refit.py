"""Full refit of an effect: Gauss-Newton on stiffness and effect, with the model solved at every step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.forward.effect import Effect
from palpate.core.inference.evidence import Directions
from palpate.core.inference.gauss_newton import gauss_newton
from palpate.core.inference.posterior import Posterior, prior_precision
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.joint_states import JointLinearisation
from palpate.core.residual.linearised_model import Hypothesis
from palpate.core.residual.plain_fit import PlainFit

# Numerical: a fit ends when no parameter moves by more than this (ln G; phi in prior standard deviations), or after so
# many solves.
_TOLERANCE, _EVALUATIONS = 0.03, 9
# A ln G as near to a bound as this was held there.
_AT_BOUND = 1e-6


@dataclass(frozen=True, eq=False)
class Refit:
    """An effect's variant where it fits best.

    point : there. in_phi (n, k) derivative of its residual. covariance (t + k, t + k) of (ln G, phi). own_evidence :
    log evidence of this variant alone, linear about its optimum, against the plain model, each averaged over the noise.
    log_evidence : of the effect, the mean over its variants (`variants.of_all`). correction : what a better element adds to
    its residual. others : variants that were refitted too. beyond (t,) : how far outside its bounds ln G would fit best, to first
    order, where it ended at one; 0 elsewhere. posterior : of ln G on a grid, where it was looked at. left_mm : by how much (rms) a better
    element would move the organ's surface, where that was not taken over; 0 elsewhere.
    """

    hypothesis: Hypothesis
    linearisation: JointLinearisation
    in_phi: FloatArray
    covariance: FloatArray
    own_evidence: float
    log_evidence: float
    correction: ElementCorrection
    beyond: FloatArray
    others: tuple[Refit, ...] = ()
    posterior: Posterior | None = None
    left_mm: float = 0.0

    @property
    def phi(self) -> FloatArray:
        """Parameters (k,) of the effect."""
        return self.linearisation.phi

    @property
    def sd_phi(self) -> FloatArray:
        """Standard deviations (k,) of phi."""
        return np.sqrt(np.diag(self.covariance))[len(self.linearisation.theta) :]


def refit(fit: PlainFit, screened: Screened, which: int = 0, tolerance: float = _TOLERANCE) -> Refit | None:
    """Gauss-Newton on (ln G, phi) from the plain fit, of one variant; None when the model with the effect cannot be
    solved. tolerance : of ln G and of phi in prior standard deviations."""
    return _fitted(fit, screened, which, fit.linearisation, _start(screened, which), tolerance)


def refit_corrected(
    fit: PlainFit, screened: Screened, uncorrected: Refit, correction: ElementCorrection, tolerance: float = _TOLERANCE
) -> Refit | None:
    """Refit of one variant, started from `uncorrected`, with another correction of the quick element.

    None when the model with the effect cannot be solved.
    """
    assert uncorrected.hypothesis.variant is not None
    corrected = replace(fit, model=fit.model.corrected(correction))
    which, scales = screened.variants.index(uncorrected.hypothesis.variant), screened.effect.scales
    return _fitted(corrected, screened, which, uncorrected.linearisation, uncorrected.phi / scales, tolerance)


def _fitted(
    fit: PlainFit, screened: Screened, which: int, near: JointLinearisation, start: FloatArray, tolerance: float
) -> Refit | None:
    """Gauss-Newton from the linearisation `near` and phi / scale = start (k,)."""
    effect = screened.effect
    hypothesis = Hypothesis(effect, screened.variants[which])
    t, scales = len(fit.linearisation.theta), effect.scales
    best: tuple[float, JointLinearisation, FloatArray] | None = None
    here = near

    def linearise(x: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        nonlocal best, here
        linearisation = fit.model.solve(hypothesis, x[:t], x[t:] * scales, here)
        if linearisation is None:
            return None
        S = fit.model.directions(hypothesis, linearisation)
        here = linearisation
        r = np.concatenate([fit.weighting.whiten(linearisation.residual), x[t:]])
        J = np.block(
            [
                [fit.weighting.whiten(linearisation.in_theta), fit.weighting.whiten(S) * scales],
                [np.zeros((len(scales), t)), np.eye(len(scales))],
            ]
        )
        if best is None or r @ r < best[0]:
            best = float(r @ r), linearisation, S
        return r, J

    bounds = np.vstack([fit.linearisation.first.scene.parameters.bounds, effect.bounds / scales[:, None]])
    gauss_newton(linearise, np.concatenate([near.theta, start]), bounds, tolerance, _EVALUATIONS)
    if best is None:
        return None
    return _weighed(fit, screened, which, hypothesis, best[1], best[2])


def _start(screened: Screened, which: int) -> FloatArray:
    """Start of phi / scale (k,): half the linear estimate, at most one standard deviation, never exactly 0."""
    guess = 0.5 * screened.scores[which].estimate / screened.effect.scales
    guess = np.clip(guess, -1.0, 1.0)
    low, high = (screened.effect.bounds / screened.effect.scales[:, None]).T
    guess = np.clip(guess, np.where(np.isfinite(low), low, -np.inf), high)
    return guess if np.abs(guess).max() > 0.02 else np.clip(guess + 0.05, low, high)


def _weighed(
    fit: PlainFit,
    screened: Screened,
    which: int,
    hypothesis: Hypothesis,
    linearisation: JointLinearisation,
    S: FloatArray,
) -> Refit:
    scales = screened.effect.scales
    J = np.hstack([fit.weighting.whiten(linearisation.in_theta), fit.weighting.whiten(S)])
    t = len(linearisation.theta)
    prior = np.diag(np.concatenate([prior_precision(fit.bounds), 1.0 / scales**2]))
    covariance = np.asarray(np.linalg.inv(J.T @ J + prior), dtype=np.float64)
    slope = J.T @ fit.weighting.whiten(linearisation.residual)
    slope[t:] += linearisation.phi / scales**2
    beyond = _beyond(linearisation.theta, -(covariance @ slope)[:t], fit.bounds)
    evidence = _evidence(fit, linearisation, S, screened.effect, beyond)
    return Refit(hypothesis, linearisation, S, covariance, evidence, evidence, fit.model.correction, beyond)


def _beyond(theta: FloatArray, step: FloatArray, bounds: FloatArray) -> FloatArray:
    """The part (t,) of a step to the linear optimum that leads out of bounds (t, 2) from a theta that lies at one."""
    low, high = bounds.T
    leaves = ((theta <= low + _AT_BOUND) & (step < 0.0)) | ((theta >= high - _AT_BOUND) & (step > 0.0))
    return np.where(leaves, step, 0.0)


def _evidence(fit: PlainFit, refitted: JointLinearisation, S: FloatArray, effect: Effect, beyond: FloatArray) -> float:
    """Log evidence against the plain model, both averaged over the noise; what is held at a bound stays there."""
    (low, high), phi = effect.bounds.T, refitted.phi
    near = _AT_BOUND * effect.scales
    free = np.concatenate([beyond == 0.0, (phi > low + near) & (phi < high - near)])
    added = [Directions(S, effect.scales, effect.bounds, phi)]
    r, J = refitted.residual[:, None], refitted.in_theta
    return float(fit.noise.log_evidence(r, J, prior_precision(fit.bounds), added, free)[0, 0]) - fit.log_evidence
