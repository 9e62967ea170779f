"""Judgement of a body: its hypotheses are compared as those of a pair are; what is left out is a state, or of one state a marker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.diagnose.bench_bodies.fit import BodyFit
from palpate.core.diagnose.bench_bodies.on_bench import on_bench
from palpate.core.diagnose.comparison import Comparison, compared
from palpate.core.diagnose.detection.score_test import screen
from palpate.core.diagnose.effects import Effect, Surroundings
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.verdict.decide import decide
from palpate.core.diagnose.verdict.judge import effect_id, effect_model, not_predicted, plain_model
from palpate.core.diagnose.verdict.verdict import Verdict
from palpate.core.inference.evidence import Directions
from palpate.core.inference.heldout import Split
from palpate.core.worker.progress import Progress, part, silent

GRAVITY = "gravity_change"


@dataclass(frozen=True, eq=False)
class BodyDiagnosis:
    """All that was found. left_out : residuals (n,) of all data, predicted without their own patch (`patches_of`), by effect id; "" for
    the plain model."""

    base: BodyFit
    found: Comparison
    verdict: Verdict
    left_out: Mapping[str, FloatArray]

    @property
    def lead(self) -> Refit | None:
        """The most probable hypothesis of those refitted."""
        return self.found.lead

    @property
    def named(self) -> Refit | None:
        """The effect that the verdict names alone."""
        return self.lead if self.verdict.candidates == (self.verdict.verdict,) else None

    def foretold_mm(self, name: str) -> FloatArray | None:
        """Error (states,) mm rms of every state's markers predicted from the other states; None where there is one state."""
        if len(self.base.data) < 2:
            return None
        return np.array([rms_mm(missed) for missed in self.base.missed(self.left_out[name])])


def judged(base: BodyFit, effects: Mapping[str, Effect], seed: int = 1, progress: Progress = silent) -> BodyDiagnosis:
    """The diagnosis of a body's fit. effects : the library by id. seed : of the draws of noise. Raises InputError when nothing holds the
    body."""
    rules, fit = base.options.decision_rules, base.plain
    progress(0.0, "score test of every effect")
    here = screen(fit, on_bench(effects, base.problem), Surroundings(base.problem.shell))
    acting = _acting(base)
    found = compared(fit, here, unnamed(base), rules, seed, part(progress, 0.1, 0.9), acting=acting)
    progress(0.9, "every state predicted from the others")
    split = split_of(base)
    models = {"": plain_model(fit)} | {effect_id(f): effect_model(f) for f in (*found.refits, *found.pairs)}
    left_out = dict(zip(models, split.left_out(list(models.values())), strict=True))
    lead = found.lead
    checks = [not_predicted(split, lead, rules, seed)] if lead is not None and found.test.detected else []
    lacking = tuple(name for name in acting if found.factors.get(name, -np.inf) > np.log(1.0 - rules.sure))
    verdict = decide(found.probability, found.test.detected, checks, lacking=lacking, rules=rules)
    return BodyDiagnosis(base, found, verdict, left_out)


def unnamed(base: BodyFit) -> list[Directions]:
    """A displacement of every state's markers that no effect of the library makes."""
    fit, columns = base.plain, []
    for data, rows in zip(base.data, fit.model.rows, strict=True):
        S = np.zeros((fit.model.n, 3))
        S[rows.start : rows.start + data.n_seen] = np.tile(np.eye(3), (len(data.seen), 1))[data.seen.ravel()]
        columns.append(S[:, S.any(axis=0)])
    S = np.hstack(columns)
    return [Directions.at_zero(S, np.full(S.shape[1], base.options.decision_rules.bench_unnamed_mm))]


def split_of(base: BodyFit) -> Split:
    """The data as they are, in the patches that are left out."""
    n = base.plain.model.n
    return Split(np.eye(n), patches_of(base), base.plain.weighting.covariance, {"markers": slice(0, n)})


def patches_of(base: BodyFit) -> IntArray:
    """Patch (n,) of each row: its state; where there is one state its marker, and reactions are never left out."""
    out = np.full(base.plain.model.n, -1)
    for k, (data, rows) in enumerate(zip(base.data, base.plain.model.rows, strict=True)):
        out[rows] = k
        if len(base.data) == 1:
            out[rows] = -1
            out[rows.start : rows.start + data.n_seen] = np.repeat(np.arange(len(data.seen)), 3)[data.seen.ravel()]
    return out


def rms_mm(missed: FloatArray) -> float:
    """Root mean square distance of markers, mm, along the axes seen; missed (k, 3) mm, NaN where not seen."""
    return float(np.sqrt(np.nansum(missed**2, axis=1).mean()))


def _acting(base: BodyFit) -> tuple[str, ...]:
    """Gravity, where it is known to act and the plain model has none."""
    acts = any(np.linalg.norm(s.gravity) > 0.1 for s in base.problem.states)
    return (GRAVITY,) if acts and not base.problem.model_gravity else ()
