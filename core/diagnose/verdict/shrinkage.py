"""Shrinkage of the gap on points that the fit has not seen."""

from __future__ import annotations

import numpy as np
from scipy import stats
from scipy.special import softmax

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.diagnosis_record import ShrinkageRecord
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.verdict.judge import Diagnosis
from palpate.core.residual.noise_covariance import organ_contours, organ_errors


def shrinkage(diagnosis: Diagnosis, best: Refit, seed: int = 1) -> ShrinkageRecord:
    """rms before and after, the share gone, that share above the noise floor, its interval by a bootstrap of whole
    patches.

    Every draw of the bootstrap takes one of the refitted effects, by its probability, and one of the sizes that the
    contours' noise may have: the interval is for what adding the true effect would do, and which one that is may not be
    sure. The ceiling is what a saturated smooth field of forces gains on the same points, the placebo what random
    fields gain.
    """
    assert best.hypothesis.effect is not None
    n = len(diagnosis.split.points)
    before, after, top = (diagnosis.left_out[key][:n] ** 2 for key in ("", best.hypothesis.effect.id, "ceiling"))
    rivals, weight = _rivals(diagnosis)
    floors, likely = contours_mm2(diagnosis, best)
    floor = float(floors @ likely)
    rng = np.random.default_rng(seed)
    patch = diagnosis.split.patch[:n]
    members = [np.flatnonzero(patch == p) for p in range(diagnosis.split.n_surface)]
    tail = tail_of_few(len(members))
    draws = []
    for _ in range(diagnosis.rules.shrinkage_draws):
        chosen = np.concatenate([members[i] for i in rng.integers(len(members), size=len(members))])
        rival = rivals[rng.choice(len(rivals), p=weight)]
        draws.append(_corrected(before[chosen].mean(), rival[chosen].mean(), rng.choice(floors, p=likely)))
    low, high = np.quantile(draws, [tail, 1.0 - tail]).tolist()
    return ShrinkageRecord(
        held_out_rms_before_mm=float(np.sqrt(before.mean())),
        held_out_rms_after_mm=float(np.sqrt(after.mean())),
        fraction=_fraction(before.mean(), after.mean()),
        noise_corrected_fraction=_corrected(before.mean(), after.mean(), floor),
        ci95=(low, high),
        ceiling_fraction=_corrected(before.mean(), top.mean(), floor),
        placebo_fraction=diagnosis.placebo,
        noise_floor_mm=float(np.sqrt(floor)),
        effect=best.hypothesis.effect.id,
    )


def tail_of_few(n: int) -> float:
    """Tail of a 95 % bootstrap interval from n blocks, widened because a few blocks, resampled, scatter too little.

    Hesterberg (2015), The American Statistician 69, 371-386, "expanded percentile interval".
    """
    return float(stats.norm.sf(np.sqrt(n / (n - 1.0)) * stats.t.isf(0.025, n - 1))) if n > 1 else 0.0


def _rivals(diagnosis: Diagnosis) -> tuple[list[FloatArray], FloatArray]:
    """Squares (n,) mm2 that each refitted effect leaves on points left out, and the effects' probabilities among each
    other."""
    n = len(diagnosis.split.points)
    named = [(f.hypothesis.effect.id, f.log_evidence) for f in diagnosis.refits if f.hypothesis.effect is not None]
    # From evidence: where no effect comes near a free field, all their probabilities may have become 0.
    return [diagnosis.left_out[name][:n] ** 2 for name, _ in named], softmax([evidence for _, evidence in named])


def contours_mm2(diagnosis: Diagnosis, best: Refit) -> tuple[FloatArray, FloatArray]:
    """What the organ's two contours alone add to the mean square of the points left out, for every size that noise may
    have, and how probable each is where the best effect fits, (g,) each.

    Walls read wrongly and the model's own errors stay with the model: no better scan of the organ would take them away.
    """
    fit = diagnosis.fit
    data, scene = fit.model.first.data, fit.linearisation.first.scene
    n = len(diagnosis.split.points) // len(fit.model.each)  # as much in every state
    errors = organ_errors(scene, fit.linearisation.first.equilibrium.u)
    reader = diagnosis.split.reader[:n, : data.n_modes]
    of_length = {
        length: np.einsum("ij,jk,ik->", reader, organ_contours(data, errors, length), reader) / n
        for length in (*fit.options.lengths_mm, fit.options.long_mm)
    }
    own = float((reader**2).sum()) / n
    contour = [(1.0 - s.long) * of_length[s.length] + s.long * of_length[fit.options.long_mm] for s in fit.noise.sizes]
    floors = np.array([s.contour**2 * c + s.own**2 * own for s, c in zip(fit.noise.sizes, contour, strict=True)])
    J = np.hstack([best.linearisation.in_theta, best.in_phi])
    none = np.zeros((fit.model.n, fit.model.n))
    return floors, softmax(fit.noise.log_likelihood(best.linearisation.residual, J, none) + fit.noise.log_prior)


def _fraction(before: float, after: float) -> float:
    return float(1.0 - np.sqrt(after / max(before, 1e-30)))


def _corrected(before: float, after: float, floor: float) -> float:
    """Share of the rms above the noise floor that is gone."""
    excess = [np.sqrt(max(x - floor, 0.0)) for x in (before, after)]
    if excess[0] <= 1e-12:
        return 0.0
    return float(np.clip(1.0 - excess[1] / excess[0], -1.0, 1.0))
