"""Judgement of refits: prediction of data left out, placebos, remainder, pairs; and the diagnosis as one value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.gap_test import GapTest, gap_test
from palpate.core.diagnose.detection.leave_out import bone_split, organ_split
from palpate.core.diagnose.detection.location import DiscrepancyMaps
from palpate.core.diagnose.detection.placebo import PlaceboSize, moved_gains, placebo_gains
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.refit.pairs import JOINED, refit_pairs
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.verdict.decide import decide
from palpate.core.diagnose.verdict.verdict import Judged, Verdict
from palpate.core.inference.evidence import projected
from palpate.core.inference.heldout import Gain, Linear, Split, gain, gain_error
from palpate.core.inference.posterior import prior_precision
from palpate.core.inference.posterior import unknown as untold
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.residual.unknown_field import UnknownDiscrepancy
from palpate.core.statistics import rms


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that was found; `palpate.core.diagnose.verdict.record` writes it down.

    refits : best first. gains : of each refit, by effect id; placebo : median share gained by placebos of the best
    one's size. forces : the free smooth field that stands for what has no name. rules : the numbers that decided.
    pairs : refits of two effects together, best first, where the best one predicts more than one effect alone.
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
    test: GapTest,
    screened: Sequence[Screened],
    refits: Sequence[Refit],
    discrepancy: DiscrepancyMaps,
    forces: UnknownDiscrepancy,
    unknown: float,
    rules: DecisionRules,
    seed: int,
) -> Diagnosis:
    split, plain = organ_split(fit, rules), plain_model(fit)
    effects = {_name(f): effect_model(f) for f in refits}
    models = {"": plain, "ceiling": saturated_model(fit, forces)} | effects
    left_out = dict(zip(models, split.left_out(list(models.values())), strict=True))
    before = left_out[""]
    ceiling = gain(split, before, left_out["ceiling"])
    gains = {
        name: gain(split, before, left_out[name], gain_error(split, plain, m, rules.gain_draws))
        for name, m in effects.items()
    }
    gains |= {name: gains[name] + more for name, more in _gains_on_bone(fit, plain, effects, rules).items()}
    by_id = {s.effect.id: s for s in screened}
    model = _Placebos(split, plain, before, forces, rules, seed)
    all_judged, shares = [], [0.0]
    for rank, f in enumerate(refits):
        name = _name(f)
        p, share = model.against(fit, f, by_id[name], gains[name]) if rank < rules.placebo_tested else (1.0, 0.0)
        shares += [share]
        all_judged.append(_judged(fit, f, refits[0], gains[name], ceiling, p, forces, rules, seed))
    much_left = bool(all_judged) and all_judged[0].remainder_p < rules.remainder_level
    pairs = refit_pairs(fit, screened, refits, rules) if much_left else []
    pair = None
    if pairs and foretells_more(
        fit, split, left_out[_name(refits[0])], effects[_name(refits[0])], effect_model(pairs[0]), rules
    ):
        pair = (tuple(_name(pairs[0]).split(JOINED)), pairs[0].log_evidence)
    told = not (untold(fit.posterior).all() and _moved(fit))
    first_look = {s.effect.id: s.log_evidence for s in screened if s.effect.id not in effects}
    verdict = decide(test.detected, all_judged, unknown, pair, first_look=first_look, told=told, rules=rules)
    return Diagnosis(
        fit,
        test,
        screened,
        refits,
        verdict,
        discrepancy,
        split,
        left_out,
        gains,
        ceiling,
        shares[:2][-1],
        forces,
        rules,
        pairs if pair is not None else (),
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


def foretells_more(
    fit: PlainFit, split: Split, alone: FloatArray, single: Linear, both: Linear, rules: DecisionRules
) -> bool:
    """Whether two effects together predict what was left out better than the better of them by itself, as a single one
    must.

    alone : (m,) what that one leaves there. By evidence alone strong motions of bone were answered with a second cause
    that was not there: what a right model leaves of a large motion stands out of the noise too, and another effect
    takes some of it.
    """
    organ_gain = gain(split, alone, split.left_out([both])[0], gain_error(split, single, both, rules.gain_draws))
    return rules.accepts(sum(_gains_on_bone(fit, single, {"both": both}, rules).values(), organ_gain))


def _gains_on_bone(
    fit: PlainFit, plain: Linear, effects: Mapping[str, Linear], rules: DecisionRules
) -> dict[str, Gain]:
    """Of effects that move bone: what each gains on patches of it that were left out."""
    out: dict[str, Gain] = {}
    for state, at in enumerate(fit.model.bones):
        moving = {} if at is None else {name: m for name, m in effects.items() if m.J[at].any()}
        split = bone_split(fit, state, rules) if moving else None
        if split is None:
            continue
        before, *after = split.left_out([plain, *moving.values()])
        for (name, m), a in zip(moving.items(), after, strict=True):
            bone_gain = gain(split, before, a, gain_error(split, plain, m, rules.gain_draws))
            out[name] = out[name] + bone_gain if name in out else bone_gain
    return out


@dataclass(frozen=True, eq=False)
class _Placebos:
    """What placebo effects are compared on."""

    split: Split
    plain: Linear
    before: FloatArray
    forces: UnknownDiscrepancy
    rules: DecisionRules
    seed: int

    def against(self, fit: PlainFit, refit: Refit, screened: Screened, g: Gain) -> tuple[float, float]:
        """Share of placebos that gain as much as g, of random loads or of other places, and the median share random
        loads gain."""
        change = refit.linearisation.residual - fit.linearisation.residual
        like = PlaceboSize.of(change, len(refit.phi), fit.weighting)
        count, response = self.rules.placebos, self.forces.response
        loads = placebo_gains(self.split, self.plain, self.before, response, like, count, self.seed)
        p = _share_as_good(loads, g)
        variant = refit.hypothesis.variant
        if variant is not None and variant.where is not None:
            apart = self.rules.placebo_apart_mm
            moved = moved_gains(self.split, self.plain, self.before, screened, variant.where, apart)
            p = max(p, _share_as_good(moved, g))
        return p, float(np.median([q.share for q in loads]))


def _judged(
    fit: PlainFit,
    f: Refit,
    best: Refit,
    g: Gain,
    ceiling: Gain,
    placebo_p: float,
    forces: UnknownDiscrepancy,
    rules: DecisionRules,
    seed: int,
) -> Judged:
    share = g.total_mm2 / ceiling.total_mm2 if ceiling.total_mm2 > 0.0 else 1.0
    J = np.hstack([f.linearisation.in_theta, f.in_phi])
    p_left = gap_test(fit.noise, f.linearisation.residual, J, forces.free, seed=seed, rules=rules).p_value
    evidence = f.log_evidence
    return Judged(_name(f), evidence, g, placebo_p, share, p_left, _imitation(fit, best, f), _unlike(fit, f, rules))


def _name(refit: Refit) -> str:
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


def _share_as_good(placebos: Sequence[Gain], g: Gain) -> float:
    return float(np.mean([q.total_mm2 >= g.total_mm2 for q in placebos])) if placebos else 0.0


def _imitation(fit: PlainFit, best: Refit, other: Refit) -> float:
    """Cosine between the best effect's change of the data, J projected out, and its image in the other's directions."""
    J = fit.weighting.whiten(best.linearisation.in_theta)
    done = projected(J, fit.weighting.whiten(best.in_phi @ best.phi))
    could = projected(J, fit.weighting.whiten(other.in_phi))
    residual = projected(could, done)
    length = max(float(done @ done), 1e-30)
    return float(np.sqrt(max(1.0 - float(residual @ residual) / length, 0.0)))


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
