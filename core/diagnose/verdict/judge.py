"""Judgement of refits: prediction of data left out, model checks, the verdict; and the diagnosis as one value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.comparison import Comparison
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.gap_test import GapTest, free_field, null_distribution
from palpate.core.diagnose.detection.leave_out import data_split
from palpate.core.diagnose.detection.location import DiscrepancyMaps
from palpate.core.diagnose.detection.placebo import PlaceboSize, placebo_gains
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.posterior import UNKNOWN
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.verdict.decide import decide
from palpate.core.diagnose.verdict.verdict import ModelCheck, Verdict
from palpate.core.inference.evidence import Directions
from palpate.core.inference.heldout import Gain, Linear, Split, gain, predictive_p
from palpate.core.inference.posterior import prior_precision
from palpate.core.inference.posterior import unknown as untold
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.residual.unknown_field import UnknownDiscrepancy
from palpate.core.statistics import rms


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that was found; `palpate.core.diagnose.verdict.record` writes it down.

    refits : best first. pairs : refits of two effects together, best first. left_out : residuals predicted without their own patch, by
    effect id, "" for the plain model and "ceiling" for a free field; gains : of each refit; placebo : median share gained by placebos of
    the best one's size. forces : the free smooth field that stands for what has no name. rules : the numbers that decided.
    """

    fit: PlainFit
    test: GapTest
    screened: Sequence[Screened]
    refits: Sequence[Refit]
    verdict: Verdict
    discrepancy: DiscrepancyMaps
    split: Split
    left_out: Mapping[str, FloatArray]
    gains: Mapping[str, Gain]
    ceiling: Gain
    placebo: float
    forces: UnknownDiscrepancy
    rules: DecisionRules
    pairs: Sequence[Refit] = ()


def judge(
    fit: PlainFit,
    found: Comparison,
    discrepancy: DiscrepancyMaps,
    forces: UnknownDiscrepancy,
    rules: DecisionRules,
    seed: int,
) -> Diagnosis:
    """The diagnosis of a plain fit whose hypotheses were compared."""
    split, plain = data_split(fit, rules), plain_model(fit)
    effects = {effect_id(f): effect_model(f) for f in (*found.refits, *found.pairs)}
    models = {"": plain, "ceiling": saturated_model(fit, forces)} | effects
    left_out = dict(zip(models, split.left_out(list(models.values())), strict=True))
    gains = {name: gain(split, left_out[""], left_out[name]) for name in models if name}
    lead = found.lead
    checks = model_checks(fit, lead, split, forces, rules, seed) if lead is not None and found.test.detected else []
    told = not (untold(fit.posterior).all() and _moved(fit))
    return Diagnosis(
        fit,
        found.test,
        found.screened,
        found.refits,
        decide(found.probability, found.test.detected, checks, told=told, rules=rules),
        discrepancy,
        split,
        left_out,
        gains,
        gains["ceiling"],
        0.0 if lead is None else _placebo_share(fit, split, left_out[""], lead, forces, rules, seed),
        forces,
        rules,
        found.pairs,
    )


def _moved(fit: PlainFit) -> bool:
    """Whether the organ moved by more than noise in any state: where nothing moved, nothing can be left out either."""
    for linearisation, data, noise_mm in zip(
        fit.linearisation.each, fit.model.data_vectors, fit.noise_rms_mm, strict=True
    ):
        still = data.residual(linearisation.scene, np.zeros_like(linearisation.equilibrium.u))
        if np.sqrt((still[: data.n_modes] ** 2).sum() / len(data.modes)) > noise_mm:
            return True
        if not data.n_modes and rms(still[data.motion]) > 1.0:  # of unit variance
            return True
    return False


def model_checks(
    fit: PlainFit, lead: Refit, split: Split, forces: UnknownDiscrepancy, rules: DecisionRules, seed: int
) -> list[ModelCheck]:
    """Whether the leading hypothesis predicts what was left out, leaves no more than noise, and means what its name says."""
    said = _unlike(fit, lead, rules)
    return [
        not_predicted(split, lead, rules, seed),
        ModelCheck(
            "something_left",
            remainder_p(fit, lead, free_field(forces.free, fit.options.gap_sizes), rules, seed),
            "the effect explains the gap best, but what it leaves is still more than noise: it may stand for something like it",
        ),
        ModelCheck("unlike_its_name", 0.0 if said else 1.0, said),
    ]


def not_predicted(split: Split, lead: Refit, rules: DecisionRules, seed: int) -> ModelCheck:
    """Whether a hypothesis misses what was left out by more than it says that it may."""
    return ModelCheck(
        "not_predicted",
        predictive_p(split, effect_model(lead), rules.draws, seed),
        "the effect fits best, but misses what was left out by more than it says that it may",
    )


def remainder_p(fit: PlainFit, lead: Refit, unnamed: Sequence[Directions], rules: DecisionRules, seed: int) -> float:
    """p-value of a cause without a name in what the hypothesis leaves; its parameters are projected out as the stiffness is."""
    assert lead.hypothesis.effect is not None
    J = np.hstack([lead.linearisation.in_theta, lead.in_phi])
    precision = np.concatenate([prior_precision(fit.bounds), 1.0 / lead.hypothesis.effect.scales**2])
    left = null_distribution(
        fit.noise, lead.linearisation.residual, J, precision, {UNKNOWN: unnamed}, seed, rules=rules
    )
    return left.test().p_value


def _placebo_share(
    fit: PlainFit,
    split: Split,
    before: FloatArray,
    lead: Refit,
    forces: UnknownDiscrepancy,
    rules: DecisionRules,
    seed: int,
) -> float:
    """Median share of the mean square on data left out that random loads as strong and as free as an effect gain."""
    change = lead.linearisation.residual - fit.linearisation.residual
    like = PlaceboSize.of(change, len(lead.phi), fit.weighting)
    gained = placebo_gains(split, plain_model(fit), before, forces.response, like, rules.placebos, seed)
    return float(np.median([one.share for one in gained]))


def effect_id(refit: Refit) -> str:
    """Id of the effect, or of two together."""
    assert refit.hypothesis.effect is not None
    return refit.hypothesis.effect.id


def _unlike(fit: PlainFit, refit: Refit, rules: DecisionRules) -> str:
    """Why what fits best is not what its name means: by its size, or since bones that it moves did not move as one."""
    assert refit.hypothesis.effect is not None
    names = [p.name for p in refit.hypothesis.effect.parameters]
    said = refit.hypothesis.effect.unlike(dict(zip(names, refit.phi.tolist(), strict=True)))
    for state, at in zip(fit.model.each, fit.model.bones, strict=True):
        if said or state.data.bone is None or at is None or not refit.in_phi[at].any():
            continue
        step = state.data.bone.step
        if step.share > rules.step_share and step.aside_mm > rules.step_mm:
            said = (
                f"the bones did not move as one: above z = {step.level_mm:.0f} mm they lie {step.aside_mm:.1f} mm aside, as where the "
                "patient moved during the scan, or where bones moved against each other"
            )
    return said


def plain_model(fit: PlainFit) -> Linear:
    """The plain model, linear around its fit."""
    t = fit.linearisation.in_theta.shape[1]
    return Linear(fit.linearisation.residual, fit.linearisation.in_theta, np.zeros(t), prior_precision(fit.bounds))


def saturated_model(fit: PlainFit, forces: UnknownDiscrepancy) -> Linear:
    """The plain model with a free smooth field, linear around its fit."""
    plain, k = plain_model(fit), forces.free.shape[1]
    return replace(
        plain,
        J=np.hstack([plain.J, forces.free]),
        value=np.zeros(plain.J.shape[1] + k),
        precision=np.concatenate([plain.precision, np.ones(k)]),
    )


def effect_model(refit: Refit) -> Linear:
    """The model with an effect or two, linear around its fit."""
    assert refit.hypothesis.effect is not None
    t, scales = len(refit.linearisation.theta), refit.hypothesis.effect.scales
    return Linear(
        refit.linearisation.residual,
        np.hstack([refit.linearisation.in_theta, refit.in_phi]),
        np.concatenate([np.zeros(t), refit.phi]),
        np.concatenate([prior_precision(refit.linearisation.first.scene.parameters.bounds), 1.0 / scales**2]),
    )
