"""The stiffness with whatever causes the gap, when it is not sure what does: the mean over all causes, by their
probability.

The best effect's own interval takes the effect for granted. Where two explain the gap about as well and mean different
stiffnesses, the answer is as uncertain as the choice between them (Bayesian model averaging; Hoeting et al. 1999, eq. 1
to 3). The same within one effect: tissue that is twelve times stiffer behind the organ, or twelve times softer before
it, looks the same, but the organ's stiffness, known relative to the tissue's alone, then differs by that factor.

What walls read wrongly pull the fitted ln G by is taken off (`wall_bias`), and so is what effect-free cases of a known
stiffness are too high by beyond that; standard deviations are widened by what they show beyond them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import softmax

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.verdict.judge import Diagnosis, saturated_model, tempered
from palpate.core.diagnose.verdict.verdict import UNKNOWN
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.residual.wall_error_bias import wall_bias


def plain_stiffness(fit: PlainFit, rules: DecisionRules) -> tuple[FloatArray, FloatArray]:
    """ln G (t,) and its covariance (t, t) without an effect."""
    J = fit.weighting.whiten(fit.linearisation.in_theta)
    covariance = np.asarray(np.linalg.inv(J.T @ J + rules.stiffness_prior * np.eye(J.shape[1])))
    bias = wall_bias(fit.noise_slope, covariance, rules.bias_least)
    theta = fit.linearisation.theta - bias - too_stiff_by(covariance, rules)
    return _allowed(fit, theta), rules.wider**2 * covariance


def model_average(diagnosis: Diagnosis) -> tuple[FloatArray, FloatArray]:
    """ln G (t,) and its covariance (t, t), over every effect that was refitted and a free smooth field in place of
    "unknown"."""
    fit, rules = diagnosis.fit, diagnosis.rules
    models = {
        f.hypothesis.effect.id: over_variants(f, fit.noise_slope, fit.options.short_by, rules)
        for f in diagnosis.refits
        if f.hypothesis.effect is not None
    }
    models[UNKNOWN] = _unnamed(diagnosis)
    mean, covariance = mixture(models, diagnosis.verdict.probability)
    return _allowed(fit, mean - too_stiff_by(covariance, rules)), rules.wider**2 * covariance


def too_stiff_by(covariance: FloatArray, rules: DecisionRules) -> FloatArray:
    """How far ln G (t,) is too high, for its covariance (t, t) under likelihood and prior: where the prior alone
    speaks, not at all."""
    data_share = np.clip(1.0 - rules.stiffness_prior * covariance.sum(axis=1), 0.0, 1.0)
    return np.asarray(rules.too_stiff * data_share)


def mixture(
    models: Mapping[str, tuple[FloatArray, FloatArray]], probability: Mapping[str, float]
) -> tuple[FloatArray, FloatArray]:
    """Mean (t,) and covariance (t, t) of a mixture of normal distributions; probabilities are taken over those in
    `models` alone."""
    weight = np.array([probability.get(name, 0.0) for name in models])
    weight = weight / weight.sum()
    means = np.stack([mean for mean, _ in models.values()])
    mean = weight @ means
    off = means - mean
    covariance = sum(w * (C + np.outer(d, d)) for w, (_, C), d in zip(weight, models.values(), off, strict=True))
    return mean, np.asarray(covariance)


def over_variants(
    best: Refit, slope: FloatArray, short_by: float, rules: DecisionRules
) -> tuple[FloatArray, FloatArray]:
    """ln G (t,) and its covariance (t, t) over the variants of an effect that were refitted, by their tempered
    evidence.

    slope (t,) : see `noise_slope`. short_by : see `tempered`.
    """
    t = len(best.linearisation.theta)
    variants = (best, *best.others)
    each = [(f.linearisation.theta, f.covariance[:t, :t]) for f in variants]
    models = {str(k): (theta - wall_bias(slope, C, rules.bias_least), C) for k, (theta, C) in enumerate(each)}
    weight = softmax([tempered(f.own_evidence, short_by) for f in variants])
    return mixture(models, {str(k): float(w) for k, w in enumerate(weight)})


def _unnamed(diagnosis: Diagnosis) -> tuple[FloatArray, FloatArray]:
    """ln G where a free smooth field takes what it can, to first order, held between its bounds."""
    fit, t = diagnosis.fit, len(diagnosis.fit.linearisation.theta)
    model = saturated_model(fit, diagnosis.forces)
    J = fit.weighting.whiten(model.J)
    covariance = np.asarray(np.linalg.inv(J.T @ J + np.diag(model.precision)), dtype=np.float64)
    step = -covariance[:t] @ (J.T @ fit.weighting.whiten(model.r))
    theta = _allowed(fit, fit.linearisation.theta + step)
    return theta - wall_bias(fit.noise_slope, covariance[:t, :t], diagnosis.rules.bias_least), covariance[:t, :t]


def _allowed(fit: PlainFit, theta: FloatArray) -> FloatArray:
    """Held between ln G's bounds."""
    low, high = fit.linearisation.first.scene.parameters.bounds.T
    return np.clip(theta, low, high)
