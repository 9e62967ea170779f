"""Shrinkage of the gap on points that the fit has not seen."""

from __future__ import annotations

import numpy as np
from scipy.special import softmax

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.diagnosis_record import PartShrinkageRecord, ShrinkageRecord
from palpate.core.diagnose.posterior import log_prior
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.verdict.judge import Diagnosis, effect_id, effect_model, saturated_model
from palpate.core.diagnose.verdict.true_error import NoiseOfPoints, TrueError
from palpate.core.statistics import rms

# Effects less probable than this are not drawn from: a truncation.
_NEGLIGIBLE = 1e-3


def shrinkage(diagnosis: Diagnosis, best: Refit, seed: int = 1) -> ShrinkageRecord:
    """rms before and after, the share gone, that share of the model's true error, and its interval.

    What the model errs by in truth is drawn from its posterior (`true_error`). For the interval every draw takes one of the refitted
    effects, by its probability: it is for what adding the true effect would do, and which one that is may not be sure. The ceiling is
    what a saturated smooth field of forces gains on the same points, the placebo what random fields gain.
    """
    assert best.hypothesis.effect is not None
    split, rng, count = diagnosis.split, np.random.default_rng(seed), diagnosis.rules.draws
    gaps = diagnosis.fit.options.gap_sizes
    noise = NoiseOfPoints.of(diagnosis.fit, split, diagnosis.forces.free)
    name = best.hypothesis.effect.id
    before, after, top = (diagnosis.left_out[key][split.organ] for key in ("", name, "ceiling"))
    error = noise.error_of(effect_model(best), after, gaps)
    ceiling = noise.error_of(saturated_model(diagnosis.fit, diagnosis.forces), top, (0.0,))
    low, high = np.quantile(_of_all_effects(diagnosis, noise, before, count, rng), [0.025, 0.975]).tolist()
    return ShrinkageRecord(
        held_out_rms_before_mm=float(np.sqrt(np.square(before).mean())),
        held_out_rms_after_mm=float(np.sqrt(np.square(after).mean())),
        fraction=float(1.0 - np.sqrt(np.square(after).mean() / max(np.square(before).mean(), 1e-30))),
        noise_corrected_fraction=float(np.median(_shares(error, before - after, count, rng))),
        ci95=(low, high),
        ceiling_fraction=float(np.median(_shares(ceiling, before - top, count, rng))),
        placebo_fraction=diagnosis.placebo,
        noise_floor_mm=float(np.sqrt(error.floor_mm2)),
        effect=name,
        parts={part: _in_mm(diagnosis, name, rows) for part, rows in split.parts.items()},
    )


def _in_mm(diagnosis: Diagnosis, effect: str, rows: slice) -> PartShrinkageRecord:
    """rms of some rows of what was left out."""
    before, after, top = (rms(diagnosis.left_out[key][rows]) for key in ("", effect, "ceiling"))
    return PartShrinkageRecord(before, after, top)


def _of_all_effects(
    diagnosis: Diagnosis, noise: NoiseOfPoints, before: FloatArray, count: int, rng: np.random.Generator
) -> FloatArray:
    """Draws (count,) of the share that is gone, each with one of the refitted effects, by their probabilities among each
    other."""
    named = [f for f in (*diagnosis.refits, *diagnosis.pairs) if f.hypothesis.effect is not None]
    # From evidence: where no effect comes near a free field, all their probabilities may have become 0.
    library = len(diagnosis.screened)
    weight = softmax([f.log_evidence + log_prior(effect_id(f), library, diagnosis.rules) for f in named])
    weight = np.where(weight > _NEGLIGIBLE, weight, 0.0)
    out = []
    for f, number in zip(named, rng.multinomial(count, weight / weight.sum()), strict=True):
        if number and f.hypothesis.effect is not None:
            after = diagnosis.left_out[f.hypothesis.effect.id][diagnosis.split.organ]
            error = noise.error_of(effect_model(f), after, diagnosis.fit.options.gap_sizes)
            out.append(_shares(error, before - after, int(number), rng))
    return np.concatenate(out)


def _shares(error: TrueError, moved: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Draws (count,) of the share of the plain model's error that is gone, -1 to 1. moved (m,) mm : by how much the plain model
    lies further out."""
    left = error.draws(count, rng)
    before, after = (np.linalg.norm(e, axis=1) for e in (left + error.basis.T @ moved, left))
    return np.clip(1.0 - after / np.maximum(before, 1e-12), -1.0, 1.0)
