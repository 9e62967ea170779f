"""Diagnosis of one case: arrays in, judgement out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.gap_test import NullDistribution, free_field, null_distribution
from palpate.core.diagnose.detection.location import discrepancy_maps
from palpate.core.diagnose.detection.score_test import Screened, screen
from palpate.core.diagnose.effects import Effect, Surroundings
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.diagnose.posterior import UNKNOWN
from palpate.core.diagnose.refit.element_error_of_effects import with_own_element_errors
from palpate.core.diagnose.refit.pairs import refit_pairs
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.refit.variants import refit_variants
from palpate.core.diagnose.verdict.judge import Diagnosis, judge
from palpate.core.diagnose.verdict.stiffness_with_effect import with_stiffness
from palpate.core.forward.pressure_fields import pressure_fields
from palpate.core.inference.evidence import mean_of_exponentials
from palpate.core.inference.posterior import prior_precision
from palpate.core.residual.case_data import CaseData
from palpate.core.residual.plain_fit import PlainFit, fit_plain
from palpate.core.residual.unknown_field import UnknownDiscrepancy
from palpate.core.worker.progress import Progress, part, silent

# Share of the work after which the plain model is fitted.
FITTED = 0.45


def diagnose(
    data: CaseData,
    effects: Mapping[str, Effect],
    progress: Progress = silent,
    seed: int = 1,
    options: DiagnosisOptions | None = None,
    fit: PlainFit | None = None,
) -> Diagnosis:
    """Diagnose a case, with the program's own numbers where no options are given.

    fit : the case's plain fit with these numbers, where it is known.

    Raises InputError for a problem that cannot be posed, ConvergenceError when nothing can be solved.
    """
    options = options or DiagnosisOptions()
    rules = options.decision_rules
    if fit is None:
        fit_progress = part(progress, 0.0, FITTED)
        fit = fit_plain(data.pairs, data.remeshed, fit_progress, options.noise_model, options.wall_motion)
    forces = UnknownDiscrepancy.around(fit.linearisation, fit.model.data_vectors, fit.options)
    r, J = fit.linearisation.residual, fit.linearisation.in_theta
    fit = replace(fit, noise=fit.noise.probable(r, J, forces.free, rules.noise_sizes))
    progress(0.46, "score test of every effect")
    screened, null = _looked_at(fit, screen(fit, effects, _surroundings(data, fit)), forces, rules, seed)
    test, refits, pairs = null.test(), list[Refit](), list[Refit]()
    if test.p_value <= rules.clear:
        refits = _refits(fit, screened, rules, part(progress, 0.6, 0.75))
        test = null.test({name: value for name, value in factors(null, refits).items() if name != UNKNOWN})
    if test.detected and refits:
        refits = with_own_element_errors(fit, screened, refits, rules, part(progress, 0.75, 0.87))
        progress(0.87, "two effects together")
        pairs = refit_pairs(fit, screened, refits[0], factors(null, refits), rules)
    progress(0.92, "prediction of what was left out")
    discrepancy = discrepancy_maps(fit, forces, rules)
    every = factors(null, [*refits, *pairs])
    found = judge(fit, test, screened, refits, pairs, every, discrepancy, forces, rules, seed)
    return with_stiffness(found, part(progress, 0.94, 1.0))


def factors(null: NullDistribution, refits: Sequence[Refit]) -> dict[str, float]:
    """Log Bayes factors against nothing of every hypothesis by name: at its own optimum where it was refitted, else linear about
    the plain fit."""
    linear = {name: mean_of_exponentials(null.of_data(name)) for name in null.factors}
    return linear | {f.hypothesis.effect.id: f.log_evidence for f in refits if f.hypothesis.effect is not None}


def _surroundings(data: CaseData, fit: PlainFit) -> Surroundings:
    geometry, at = fit.model.first.geometry, fit.linearisation.first
    return Surroundings(data.problem, data.gravity, lambda: pressure_fields(geometry, at.scene, at.theta))


def _looked_at(
    fit: PlainFit, screened: Sequence[Screened], forces: UnknownDiscrepancy, rules: DecisionRules, seed: int
) -> tuple[list[Screened], NullDistribution]:
    """Every effect, the likeliest first, weighed over the noise, and the same of draws of noise."""
    causes = {s.effect.id: s.linear for s in screened} | {UNKNOWN: free_field(forces.free, fit.options.gap_sizes)}
    r, J = fit.linearisation.residual, fit.linearisation.in_theta
    null = null_distribution(fit.noise, r, J, prior_precision(fit.bounds), causes, seed, rules=rules)
    weighed = [s.weighed(null.of_data(s.effect.id)) for s in screened]
    return sorted(weighed, key=lambda s: -s.log_evidence), null


def _refits(fit: PlainFit, screened: Sequence[Screened], rules: DecisionRules, progress: Progress) -> list[Refit]:
    """Effects refitted in full, best first."""
    least = screened[0].log_evidence - rules.hopeless if screened else 0.0
    worth = [s for s in screened if s.log_evidence > least or s.tried == 1]
    out = []
    for k, s in enumerate(worth):
        progress(k / len(worth), f"refit with {s.effect.id}")
        refitted = refit_variants(fit, s, rules)
        if refitted is not None:
            out.append(refitted)
    return sorted(out, key=lambda f: -f.log_evidence)
