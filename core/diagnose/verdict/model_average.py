"""The stiffness with whatever causes the gap, when it is not sure what does: the mean over all causes, by their
probability.

The best effect's own interval takes the effect for granted. Where two explain the gap about as well and mean different
stiffnesses, the answer is as uncertain as the choice between them (Bayesian model averaging; Hoeting et al. 1999, eq. 1
1 to 3). The same within one effect: tissue that is twelve times stiffer behind the organ, or twelve times softer before
it, moves the same, but the organ's stiffness, known relative to the tissue's alone, then differs by that factor. A fit of one
is a fit of the other (`Parameter.over_reference`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.special import softmax

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.verdict.judge import Diagnosis, saturated_model
from palpate.core.diagnose.verdict.verdict import UNKNOWN
from palpate.core.inference.truncated_normal import Cut, cut
from palpate.core.residual.plain_fit import PlainFit


def plain_stiffness(fit: PlainFit) -> tuple[FloatArray, FloatArray]:
    """ln G (t,) and its covariance (t, t) without an effect: what `identify` reports."""
    return fit.posterior.mean, fit.posterior.covariance


def model_average(diagnosis: Diagnosis) -> tuple[FloatArray, FloatArray]:
    """ln G (t,) and its covariance (t, t), over all that was refitted, one effect or two, and a free smooth field in place of
    "unknown"."""
    models = {
        f.hypothesis.effect.id: over_variants(f)
        for f in (*diagnosis.refits, *diagnosis.pairs)
        if f.hypothesis.effect is not None
    }
    models[UNKNOWN] = _unnamed(diagnosis)
    mean, covariance = mixture(models, diagnosis.verdict.probability)
    return _allowed(diagnosis.fit, mean), covariance


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


def over_variants(best: Refit) -> tuple[FloatArray, FloatArray]:
    """ln G (t,) and its covariance (t, t) over the variants of an effect that were refitted, and their twins, by their evidence
    within ln G's bounds."""
    refits = [best, *best.others]
    within = [_within_bounds(f) for f in refits] + [_twin(f) for f in refits if _references(f).any()]
    models = {str(k): (of.mean, of.covariance) for k, (of, _) in enumerate(within)}
    weight = softmax([evidence for _, evidence in within])
    return mixture(models, {str(k): float(w) for k, w in enumerate(weight)})


def _within_bounds(f: Refit) -> tuple[Cut, float]:
    """ln G of a variant cut at its bounds, and its log evidence with only what lies within them.

    Laplace's integral runs over all ln G. Where the fit is held at a bound, half of it or more lies outside, and the mean of what
    is left lies inside: a variant that wants a stiffness that was not allowed weighs less, and does not say that bound.
    """
    t = len(f.linearisation.theta)
    covariance, held = f.covariance[:t, :t], f.beyond != 0.0
    # The fit's evidence belongs to where it was held; that of the normal's peak is larger.
    higher = 0.5 * float(f.beyond[held] @ np.linalg.solve(covariance[np.ix_(held, held)], f.beyond[held]))
    of = cut(f.linearisation.theta + f.beyond, covariance, f.linearisation.first.scene.parameters.bounds)
    if f.posterior is not None:  # as of the plain fit: the optimum, and the mean square about it
        of = replace(of, mean=f.posterior.mean, covariance=f.posterior.covariance)
    return of, f.own_evidence + higher + of.log_share


def _twin(f: Refit) -> tuple[Cut, float]:
    """The same where the stated stiffness is that of the tissue's other part: all stiffnesses over it, the organ's too, are as they were,
    so that ln G is smaller by the contrast. Contrasts have a prior that is even."""
    t, contrast = len(f.linearisation.theta), _references(f)
    reader = np.hstack([np.eye(t), -np.tile(contrast, (t, 1))])
    mean = f.linearisation.theta + f.beyond - contrast @ f.phi
    of = cut(mean, reader @ f.covariance @ reader.T, f.linearisation.first.scene.parameters.bounds)
    return of, f.own_evidence + of.log_share


def _references(f: Refit) -> FloatArray:
    """1 for the parameters (k,) that say how stiff one part of the tissue is over the other, else 0."""
    effect = f.hypothesis.effect
    return np.array([float(p.over_reference) for p in effect.parameters] if effect is not None else [])


def _unnamed(diagnosis: Diagnosis) -> tuple[FloatArray, FloatArray]:
    """ln G where a free smooth field takes what it can, to first order, held between its bounds."""
    fit, t = diagnosis.fit, len(diagnosis.fit.linearisation.theta)
    model = saturated_model(fit, diagnosis.forces)
    J = fit.weighting.whiten(model.J)
    covariance = np.asarray(np.linalg.inv(J.T @ J + np.diag(model.precision)), dtype=np.float64)
    step = -covariance[:t] @ (J.T @ fit.weighting.whiten(model.r))
    return _allowed(fit, fit.linearisation.theta + step), covariance[:t, :t]


def _allowed(fit: PlainFit, theta: FloatArray) -> FloatArray:
    """Held between ln G's bounds."""
    low, high = fit.bounds.T
    return np.clip(theta, low, high)
