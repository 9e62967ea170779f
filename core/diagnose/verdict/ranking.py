"""Effects of the library by their probability, in the form of diagnosis.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.diagnosis_record import ParameterRecord, RankedRecord
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.residual.plain_fit import PlainFit


def ranking(
    fit: PlainFit,
    screened: Sequence[Screened],
    refits: Sequence[Refit],
    probability: Mapping[str, float],
    gains_mm: Mapping[str, float],
) -> list[RankedRecord]:
    """Every effect looked at, most probable first, by the log evidence where none was refitted; those not refitted have their linear
    estimate.

    probability : of each cause, given a gap. gains_mm : rms gained on data left out, by effect.
    """
    fitted = {f.hypothesis.effect.id: f for f in refits if f.hypothesis.effect is not None}
    rows = []
    for s in screened:
        one = fitted.get(s.effect.id)
        evidence = s.log_evidence if one is None else one.log_evidence
        row = _row(fit, s, one, evidence, probability.get(s.effect.id, 0.0), gains_mm.get(s.effect.id, 0.0))
        rows.append((row, evidence))
    return [row for row, _ in sorted(rows, key=lambda row: -row[0].probability if fitted else -row[1])]


def _row(
    fit: PlainFit, screened: Screened, fitted: Refit | None, evidence: float, probability: float, gain_mm: float
) -> RankedRecord:
    effect, first = screened.effect, screened.scores[0]
    phi = first.estimate if fitted is None else fitted.phi
    sd = np.sqrt(np.diag(first.covariance)) if fitted is None else fitted.sd_phi
    variant = screened.variants[0] if fitted is None else fitted.hypothesis.variant
    parameters = {}
    for p, value, error in zip(effect.parameters, phi.tolist(), sd.tolist(), strict=True):
        low, high = (p.physical(float(np.clip(value + s * error, p.low, p.high))) for s in (-1, 1))
        inside = float(np.clip(value, p.low, p.high))
        parameters[p.name] = ParameterRecord(p.physical(inside), abs(high - low) / 2.0, p.unit)
    return RankedRecord(
        effect=effect.id,
        probability=probability,
        residual_share=_residual_share(fit, fitted),
        cv_gain_mm=gain_mm,
        p_value=min(1.0, first.p_value * screened.tried),
        parameters=parameters,
        variant="" if variant is None else variant.name,
        log_evidence=evidence,
        refitted=fitted is not None,
    )


def _residual_share(fit: PlainFit, fitted: Refit | None) -> float:
    """Share of the plain model's weighted square residual that is left with the effect."""
    if fitted is None:
        return 1.0
    a, b = (fit.weighting.squared(x) for x in (fitted.linearisation.residual, fit.linearisation.residual))
    return float(a / max(b, 1e-30))
